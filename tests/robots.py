"""The robots that the tests build: our own toys, and published URDFs; levels of libraries."""

from dataclasses import dataclass, field
from pathlib import Path

from runtime.library import Library, load
from symgen.chain import ChainOptions
from symgen.make.compiler import REFERENCE
from symgen.make.request import BuildRequest

DATA = Path(__file__).parent / "data"
ONE_LEVEL = ("portable",)
"""For builds whose levels are not asked about: a third of the time of all of them."""


def levels_here(lib: Library) -> tuple[str, ...]:
    """Levels of the library that this processor runs, the plainest first, without CasADi's own."""
    here = lib.levels[: lib.levels.index(load(lib.folder).level) + 1]
    return tuple(level for level in here if level != REFERENCE)


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

# What `scripts/check_models` builds beside these: every other URDF of the shared folder, and
# sub-chains, locks and mounts of them.
MORE = {
    "fr3_published": Case("franka_fr3/fr3.urdf", 43),
    "fr3_hand": Case(
        "franka_fr3/fr3_hand.urdf",
        43,
        ChainOptions(locks={"fr3_finger_joint1": 0.01, "fr3_finger_joint2": 0.01}),
    ),
    # One finger slides, the other is locked; link 4 has an impossible inertia. The finger adds its
    # mass and three first moments, which the slide moves about.
    "fer_finger": Case(
        "franka_fer/fer_hand.urdf", 47, ChainOptions(locks={"fer_finger_joint2": 0.0}), project=True
    ),
    "fer": Case("franka_fer/fer.urdf", 43, project=True),
    "gen3": Case("kinova_gen3/gen3.urdf", 43, ChainOptions(snap=1e-4)),
    "gen3_gripper": Case("kinova_gen3/gen3_2f85_fixed.urdf", 43, ChainOptions(snap=1e-4)),
    "gen3_no_vision": Case("kinova_gen3/kinova_no_vision.urdf", 43, ChainOptions(snap=1e-4)),
    "jaco": Case("kinova_jaco/kinova.urdf", 36),
    "lwr4_centro": Case("kuka_lwr4/kuka_lwr4_centroepiaggio.urdf", 43),
    "lwr4_cogimon": Case("kuka_lwr4/kuka_lwr4_cogimon.urdf", 43),
    "lwr4_gaz": Case("kuka_lwr4/kuka_lwr4_gaz.urdf", 43, project=True),
    "lwr4_identified": Case("kuka_lwr4/kuka_lwr4_identified.urdf", 43, project=True),
    "ur10": Case("universal_robots/ur10_robot.urdf", 36),
    "ur10_on_a_wall": Case(
        "universal_robots/ur10_robot.urdf", 38, ChainOptions(gravity=(9.81, 0.0, 0.0))
    ),
    # Gravity across the first axis: 3 + 7 + 7.
    "ur10_wrist": Case(
        "universal_robots/ur10_robot.urdf",
        17,
        ChainOptions(base="forearm_link", gravity=(0.0, 0.0, -9.81)),
    ),
    "ur3": Case("universal_robots/ur3_robot.urdf", 36),
    "ur3e": Case("universal_robots/ur3e_from_ur_e_description.urdf", 36),
    "ur5e": Case("universal_robots/ur5e_from_ur_e_description.urdf", 36),
    "xarm7_lbr": Case("xarm7/xarm7base_lbrstack.urdf", 43),
    "xarm7_upper_arm": Case("xarm7/xarm7.urdf", 15, ChainOptions(tip="link3")),
}
