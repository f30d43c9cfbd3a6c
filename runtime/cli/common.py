"""Parts that the commands share: robot and other options, files, progress, torque errors.

A file that exists is replaced with --overwrite only. Two exceptions, both printed: the folder of a
result is replaced by a later result of the same command, which `undo` takes back, and the page that
`report` derives from a folder by a later one. `reproduce` continues the trials of its folder and
refuses those of another configuration.
"""

import shutil
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

from runtime.common.files import bytes_of, json_of, replacing, require_unused
from runtime.common.settings import FILE, Choices, data_option, output_option
from runtime.common.terminal import completing, console, program
from runtime.common.texts import numbers_of
from runtime.common.user_builds import generated_here
from runtime.errors import IdentificationError, LibraryError, RuntimeFault
from runtime.library import Library, load
from runtime.library.library import ForeignRobotError, find
from runtime.registry import Registry

Overwrite = Annotated[bool, output_option("--overwrite", help="Replace files that exist.")]
PAGE = b'<meta name="generator" content="symgen">'  # mark of an HTML page of this package

Yes = Annotated[
    bool,
    data_option("--yes", help="Run the code of ./generated/ROBOT although you did not build it."),
]


def robots(incomplete: str) -> list[str]:
    """Names of generated robots: of the package, the working directory and all builds."""
    return completing([folder.name for folder in generated_here()])(incomplete)


Robot = Annotated[
    str, data_option("--robot", autocompletion=robots, help="Name or folder of a generated robot.")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotChoices(Choices):
    """A generated robot."""

    robot: Robot = "fr3"
    yes: Yes = False


Seed = Annotated[int, typer.Option(help="Seed of random numbers, below 2⁶³.", min=0, max=2**63 - 1)]


def sentences_of(registry: Registry[Any]) -> str:
    """`name: sentence` of every record for an option's help; a faulty plugin keeps its name."""
    parts = []
    for name in registry:
        try:
            parts.append(f"{name}: {registry[name].sentence}")
        except RuntimeFault:
            parts.append(f"{name}: a plugin that cannot be imported")
    return "; ".join(parts)


def numbers_option(text: str, count: int, option: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    values = numbers_of(text)
    if len(values) != count:
        raise IdentificationError(f"{option} needs {count} numbers with commas, got '{text}'")
    return values


def listed(text: str, known: Sequence[str], option: str) -> tuple[str, ...]:
    """Names separated by commas."""
    names = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    if any(name not in known for name in names):
        raise IdentificationError(
            f"{option} needs names with commas of {', '.join(known)}; got '{text}'"
        )
    return names


def open_robot(robot: str, yes: bool, takes_free_base: bool = False) -> Library:
    """Load the robot of a command and print on stderr whose it is."""
    lib = _opened(robot, yes)
    if lib.manifest.floating and not takes_free_base:
        raise LibraryError(
            f"this command needs a robot with a fixed base, and that of '{lib.name}' is free; use "
            "identify, compare, predict, evaluate, report, export --to urdf, sample, watch or "
            "fleet, or build the robot without --floating"
        )
    return lib


def _opened(robot: str, yes: bool) -> Library:
    try:
        place = find(robot)
    except ForeignRobotError as error:
        question = f"'{error.folder}' was not built by you. Run its code?"
        can_ask = sys.stdin.isatty() and sys.stderr.isatty()
        if not (yes or (can_ask and typer.confirm(question, default=False, err=True))):
            raise
        _announce(f"robot '{robot}' of the working directory: {error.folder}")
        return load(error.folder)
    if place.folder.name == robot:
        _announce(f"robot '{robot}' of {place.origin}: {place.folder}")
    return load(place.folder)


def counting(*columns: ProgressColumn) -> Progress:
    """Progress bar with the task, the count, the elapsed time and further columns."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        *columns,
        console=console,
        transient=True,
        disable=not console.is_terminal,  # which would leave an empty line in a file
    )


def state() -> TextColumn:
    """Column of free text, set by `state=` of `add_task` and `update`."""
    return TextColumn("{task.fields[state]}")


EARLIER, _NAMES = ".earlier", "names.txt"  # folder of a replaced result, file of both names


@dataclass(frozen=True, slots=True)
class ResultFolder:
    """What a command writes into the folder of its result, beside its settings."""

    files: tuple[str, ...]  # names of all other files that it writes
    key: str  # key of the first file, a JSON document, by which the result is recognised

    def require(self, folder: Path, given: Choices, overwrite: bool) -> None:
        """Refuse to replace files of a folder, except an earlier result of the same command."""
        if self._is_in(folder):
            _announce(f"the earlier result of {given.command} in '{folder}' will be replaced")
        else:
            require_unused((folder / name for name in (*self.files, FILE)), overwrite)

    def begin(self, folder: Path, given: Choices) -> None:
        """Write the settings of a result; one that it replaces is copied for `symgen undo`."""
        if self._is_in(folder):
            self._keep(folder)
        given.write(folder)

    def _is_in(self, folder: Path) -> bool:
        with suppress(OSError, ValueError):
            facts = json_of(folder / self.files[0])
            return isinstance(facts, dict) and self.key in facts
        return False

    def _keep(self, folder: Path) -> None:
        place, names = folder / EARLIER, (*self.files, FILE)
        with suppress(OSError):
            if place.is_dir() and not place.is_symlink():
                shutil.rmtree(place)
            place.mkdir()
            for name in filter(lambda each: (folder / each).is_file(), names):
                shutil.copy2(folder / name, place)
            (place / _NAMES).write_text("\n".join(names), encoding="utf-8")


def swap_earlier(folder: Path) -> list[str]:
    """Exchange the result of a folder with the one that it replaced; names that came back."""
    place, other = folder / EARLIER, folder / f"{EARLIER}.new"
    try:
        names = (place / _NAMES).read_text(encoding="utf-8").split("\n")
        names = [name for name in names if name == Path(name).name]
        other.mkdir()
        for name in (each for each in names if (folder / each).is_file()):
            (folder / name).replace(other / name)
        back = [name for name in names if (place / name).is_file()]
        for name in back:
            (place / name).replace(folder / name)
        (place / _NAMES).replace(other / _NAMES)
        place.rmdir()
        other.replace(place)
    except (OSError, ValueError) as error:
        raise RuntimeFault(f"cannot exchange the results of '{folder}' ({error})") from None
    return back


def require_page(path: Path, overwrite: bool) -> None:
    """Refuse to replace the default page of a folder, except a page of this package."""
    with suppress(OSError, ValueError):
        if PAGE in bytes_of(path)[:2000]:
            _announce(f"the earlier page '{path}' will be replaced")
            return
    require_unused([path], overwrite)


def write_recipe(path: Path, text: str, overwrite: bool) -> None:
    """Write a proposed recipe unless it would replace a different one."""
    data = text.encode()
    if path.is_file() and path.read_bytes() != data and not overwrite:
        raise RuntimeFault(
            f"'{path}' exists and differs from the proposed recipe; choose another place with "
            "--recipe-out and compare them, or give --overwrite"
        )
    with replacing(path) as file:
        file.write(data)


def _announce(sentence: str) -> None:
    sys.stderr.write(f"{program().split()[-1]}: {sentence}\n")
