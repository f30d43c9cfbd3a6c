"""Good descriptions of robots, each in an empty folder."""

import re
import shutil
from pathlib import Path

from runtime.library import Library
from scripts.fuzzing.texts import DH, MECHANISM, MJCF, SDF, XACRO

MODELS = Path(__file__).parents[2] / "symgen" / "robots"


def urdf(folder: Path, lib: Library) -> None:
    """The robot's URDF."""
    (folder / "robot.urdf").write_text(lib.urdf())


def mesh(folder: Path, lib: Library) -> None:
    """A URDF of one link whose shape is a mesh, in three formats."""
    import trimesh

    solid = trimesh.creation.icosphere(1, 0.1)
    for form in ("stl", "obj", "dae"):
        data = solid.export(file_type=form)
        text = data.decode("latin1") if isinstance(data, bytes) else data
        text = re.sub(r"[0-9a-f]{32}|<(created|modified)>[^<]*</\1>", "", text)  # once and for all
        (folder / f"mesh.{form}").write_bytes(text.encode("latin1"))
        text = lib.urdf().replace(
            "</inertial>",
            "</inertial>"
            + "".join(
                f'<{tag}><geometry><mesh filename="mesh.{form}"/></geometry></{tag}>'
                for tag in ("visual", "collision")
            ),
            1,
        )
        (folder / f"{form}.urdf").write_text(text)


def mjcf(folder: Path, _: Library) -> None:
    """A MuJoCo model."""
    (folder / "robot.xml").write_text(MJCF)


def sdf(folder: Path, _: Library) -> None:
    """An SDF model with a loop joint."""
    (folder / "robot.sdf").write_text(SDF)


def xacro(folder: Path, _: Library) -> None:
    """A xacro file."""
    (folder / "robot.xacro").write_text(XACRO)


def robot_config(folder: Path, _: Library) -> None:
    """Robot configuration (TOML)."""
    shutil.copy(MODELS / "fr3.toml", folder / "robot.toml")


def masses(folder: Path, lib: Library) -> None:
    """Masses of links, and a URDF without <inertial>."""
    text = "".join(f'"{name}" = 1.5\n' for name in lib.link_names)
    (folder / "masses.toml").write_text(text)
    bare = re.sub(r"<inertial>.*?</inertial>", "", lib.urdf(), flags=re.DOTALL)
    (folder / "robot.urdf").write_text(bare)


def mechanism(folder: Path, lib: Library) -> None:
    """Springs, curves and friction of a mechanism, and its URDF."""
    first = lib.joint_names[0]
    (folder / "mechanism.toml").write_text(MECHANISM.format(joint=first))
    (folder / "robot.urdf").write_text(lib.urdf())


def dh(folder: Path, _: Library) -> None:
    """Modified DH rows."""
    (folder / "rows.toml").write_text(DH)
