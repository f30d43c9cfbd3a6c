"""Folder of a robot: by name among trusted places, or by the path that the user typed."""

import os
from pathlib import Path
from typing import NamedTuple

from runtime.common.files import sha256_of
from runtime.common.user_builds import NAME, built_folders, is_user_build
from runtime.errors import LibraryError


class ForeignRobotError(LibraryError):
    """A robot of this name lies in the working directory only, and was not built by this user.

    Attributes:
        folder: its generated folder.
    """

    def __init__(self, robot: str, folder: Path) -> None:
        self.folder = folder
        super().__init__(
            f"expected '{robot}' to come with the package or to be built by you, got it only in "
            f"'{folder}'; to run the code of that folder, give --robot {folder} or --yes"
        )


class RobotFolder(NamedTuple):
    """Generated folder of a robot.

    Attributes:
        folder: the folder.
        origin: whose it is, a phrase.
    """

    folder: Path
    origin: str


def find(robot: str | os.PathLike[str]) -> RobotFolder:
    """Generated folder of a robot.

    A name, [a-z][a-z0-9_]*, is looked up in the package, then among the folders that this user has
    built, of which ./generated/<name> comes first. Anything else is a path.
    """
    if isinstance(robot, os.PathLike) or not NAME.fullmatch(robot):
        return RobotFolder(Path(robot), "the folder that was given")
    package = Path(__file__).parents[1]  # generated/ lies in it if installed, else beside it
    roots = [folder / "generated" for folder in (package, package.parent)]
    for root in roots:
        if (root / robot / "manifest.json").exists():
            return RobotFolder(root / robot, "the package")
    here = Path("generated") / robot
    if _is_built_here(here, robot):
        return RobotFolder(here, "your build")
    for folder in built_folders(robot):
        return RobotFolder(folder, "your build")
    if (here / "manifest.json").exists():
        raise ForeignRobotError(robot, here)
    bundled = (package.parent / "symgen" / "robots" / f"{robot}.urdf").exists()
    options = f"--robot {robot}" if bundled else f"--urdf FILE --name {robot}"
    raise LibraryError(
        f"no generated robot is called '{robot}' (looked in "
        f"{', '.join(str(root) for root in roots)}, your builds and {Path.cwd() / 'generated'}); "
        f"give the path of its folder, or run: python -m symgen build {options}"
    )


def _is_built_here(folder: Path, robot: str) -> bool:
    """Whether the library in a folder of the working directory was built by this user."""
    library = folder / f"lib{robot}.so"
    try:
        digest = sha256_of(library)
    except OSError:
        return False
    return (folder / "manifest.json").is_file() and is_user_build(library, digest)
