"""Robots by name from robot_descriptions and example-robot-data, where these are installed."""

from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import files
from pathlib import Path

from symgen.errors import BuildError

_ROBOTS = "share/example-robot-data/robots/"


def published_urdf(name: str) -> Path:
    """URDF of a published robot.

    A module of robot_descriptions (`NAME` or `NAME_description`) goes first, then the files of
    example-robot-data: a URDF or a folder of this name.

    Args:
        name: such as "panda", "talos_full_v2" or "go2".

    Returns:
        Path of its URDF.

    Raises:
        BuildError: neither package is installed, or none has this robot.
    """
    module = _from_robot_descriptions(name)
    if module is not None:
        return module
    robots = _example_robots()
    names = {path.stem: path for path in reversed(robots)}
    if name in names:
        return names[name]
    folders = {path.parts[path.parts.index("robots") + 1] for path in robots}
    for folder in (name, f"{name}_description", f"{name}_data"):
        inside = [path for path in robots if folder in path.parts]
        if len(inside) == 1:
            return inside[0]
        if inside:
            listed = ", ".join(path.stem for path in inside)
            raise BuildError(f"'{name}' has several URDFs; choose --description from {listed}")
    if not robots:
        raise BuildError(
            "--description reads robot_descriptions or example-robot-data, and neither is "
            "installed; run: pip install robot_descriptions"
        )
    near = get_close_matches(name, [*names, *folders], n=5, cutoff=0.4) or sorted(names)[:12]
    raise BuildError(f"no installed package describes '{name}'; there are {', '.join(near)}, …")


def _from_robot_descriptions(name: str) -> Path | None:
    if not name.isidentifier():
        return None
    for module in (name, f"{name}_description"):
        try:
            described = import_module(f"robot_descriptions.{module}")
        except ModuleNotFoundError:
            continue
        except Exception as error:  # it downloads the robot when it is imported
            reason = " ".join(str(error).split())
            raise BuildError(f"robot_descriptions cannot load '{name}': {reason}") from None
        path = getattr(described, "URDF_PATH", None) or getattr(described, "MJCF_PATH", None)
        if path:
            return Path(path)
    return None


def _example_robots() -> list[Path]:
    """URDFs of example-robot-data, by path."""
    try:
        recorded = files("example-robot-data") or []
    except ModuleNotFoundError:  # the distribution is not installed
        return []
    paths = [Path(str(f.locate())) for f in recorded if _ROBOTS in str(f) and f.suffix == ".urdf"]
    return sorted(path for path in paths if path.is_file())
