"""The robots that the tests build: our own toys, and published URDFs that stay outside."""

from dataclasses import dataclass, field
from pathlib import Path

from symgen.chain import ChainOptions
from symgen.request import BuildRequest

DATA = Path(__file__).parent / "data"


@dataclass(frozen=True, slots=True)
class Case:
    """A URDF and how to build it; `published` URDFs lie in the shared data folder.

    Compiling takes most of the tests' time: only robots whose levels are compared get all.
    """

    file: str
    base_parameters: int
    options: ChainOptions = field(default_factory=ChainOptions)
    project: bool = False
    published: bool = True
    every_level: bool = False

    def request(self, name: str, models: Path | None) -> BuildRequest:
        """The build of this robot."""
        path = (models if self.published and models else DATA) / self.file
        return BuildRequest(name, path.read_text(), self.options, project=self.project)


CASES = {
    "xarm7": Case("xarm7/xarm7.urdf", 43),
    "ur5": Case("universal_robots/ur5_robot.urdf", 36, every_level=True),
    "iiwa14": Case("iiwa14/iiwa14_uebersax.urdf", 45, ChainOptions(gravity=(1.5, -3.0, 9.0))),
    # Four-digit angles; some joints turn without end.
    "kinova_gen3": Case("kinova_gen3/kinova.urdf", 43, ChainOptions(snap=1e-4)),
    "unitree_z1": Case("unitree_z1/z1.urdf", 43),
    "kuka_lwr4": Case("kuka_lwr4/kuka_lwr4.urdf", 43),
    # The last link has mass and no inertia.
    "tx40": Case("staubli_tx40/tx40_mdh_modified.urdf", 36, project=True),
    # The hand, with its mimicking finger, is cut off.
    "panda": Case("panda_erd/panda.urdf", 43, ChainOptions(tip="panda_link8")),
    "tree": Case("tree.urdf", 22, published=False, every_level=True),
    "gantry": Case("gantry.urdf", 14, published=False, every_level=True),
}
