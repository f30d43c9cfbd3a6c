"""The console command `symgen`: one entry to the commands of both packages.

It imports the module of a command only when that command runs. `inspect` exists twice: a model
file goes to symgen, a log to runtime.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from runtime.common.commands import Command, Commands, application, imported
from runtime.common.files import require_file
from symgen import __version__
from symgen.cli import installation, start

INSPECT_FLAGS = frozenset({"--json", "--strict", "--overwrite", "--help", "-h"})
"""Options of either `inspect` that take no value; every other one is followed by its value."""

MODEL_SUFFIXES = frozenset({".urdf", ".xacro", ".mjcf", ".xml", ".sdf", ".toml"})
"""Suffixes that decide where a file is missing or empty, so that it has no content."""

_BEFORE_XML = b"\xef\xbb\xbf\xff\xfe\x00 \t\r\n"
"""Bytes that may precede `<`: byte-order marks, the zero bytes of UTF-16, white space."""


class AllCommands(Commands):
    """Commands of both packages."""

    def chosen(self, ctx: Any, named: Sequence[Command], words: Sequence[str]) -> Command:
        """Command that runs: of both named `inspect` the one that reads the file."""
        file = inspected_file(words)
        if len(named) == 1 or (file is None and ctx.resilient_parsing):
            return named[-1]
        if file is None:
            for command in named:
                try:
                    made = imported(command)
                except ModuleNotFoundError as error:
                    page = f"{command.name} {command.argument}"
                    lacking = f"needs the package {error.name}; run: {installation('build')}"
                    print(f"{page} {lacking}\n")
                    continue
                with made.make_context(
                    command.name, [], parent=ctx, resilient_parsing=True
                ) as context:
                    print(context.get_help())
            raise typer.Exit(0 if {"-h", "--help"} & {*words} else 2)
        package = "symgen" if is_model(Path(file)) else "runtime"
        return next(command for command in named if command.package == package)


app = application(
    AllCommands,
    "Physically consistent inertial parameters of robot arms, from measured motion.",
    __version__,
    add_completion=True,
)


def main() -> None:
    """Run `symgen COMMAND …` on `sys.argv`; an unknown command is one sentence and exit code 2."""
    start(app)


def inspected_file(words: Sequence[str]) -> str | None:
    """First argument of `inspect` that is not an option."""
    rest = iter(words)
    for word in rest:
        if word == "--":
            return next(rest, None)
        if not word.startswith("-") or word == "-":
            return word
        if word not in INSPECT_FLAGS and "=" not in word:
            next(rest, None)  # the value of this option
    return None


def is_model(path: Path) -> bool:
    """Whether a file is a robot model: XML or, of Denavit-Hartenberg rows, TOML; no log is."""
    try:
        require_file(path)  # the other end of a pipe may never come
        with path.open("rb") as file:
            head = file.read(4096).lstrip(_BEFORE_XML)
    except (OSError, ValueError):  # missing, a folder, or a name with a zero byte
        head = b""
    if (head and path.suffix.lower() != ".toml") or path.is_dir():
        return head.startswith(b"<")
    return path.suffix.lower() in MODEL_SUFFIXES
