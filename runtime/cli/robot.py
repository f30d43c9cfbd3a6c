"""Robot of a command by name or path, with a confirmation before the code of others runs."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.common import program
from runtime.errors import LibraryError
from runtime.library import Library, load
from runtime.library.library import ForeignRobotError, find

Yes = Annotated[
    bool,
    typer.Option("--yes", help="Run the code of ./generated/ROBOT although you did not build it."),
]


def open_robot(robot: str, yes: bool, takes_free_base: bool = False) -> Library:
    """Load the robot of a command and print on stderr whose it is."""
    lib = _opened(robot, yes)
    if lib.manifest.floating and not takes_free_base:
        raise LibraryError(
            f"this command needs a robot with a fixed base, and that of '{lib.name}' is free; use "
            "identify --rows, or build the robot without --floating"
        )
    return lib


def _opened(robot: str, yes: bool) -> Library:
    try:
        place = find(robot)
    except ForeignRobotError as error:
        if not (yes or _agreed(error)):
            raise
        _say(robot, "the working directory", error.folder)
        return load(error.folder)
    if place.folder.name == robot:
        _say(robot, place.origin, place.folder)
    return load(place.folder)


def _say(robot: str, origin: str, folder: Path) -> None:
    sys.stderr.write(f"{program().split()[-1]}: robot '{robot}' of {origin}: {folder}\n")


def _agreed(error: ForeignRobotError) -> bool:
    """Whether the user runs the code of a folder: by an answer at the terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    return typer.confirm(
        f"'{error.folder}' was not built by you. Run its code?", default=False, err=True
    )
