"""What commands of both packages print: sentences, names of programs, texts of `--help`."""

import shlex
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from rich.console import Console

__all__ = [
    "command_line",
    "completing",
    "console",
    "program",
    "say",
]

console = Console()


def say(text: str) -> None:
    """Print one line to the terminal without markup, with commands as the user types them."""
    console.print(as_typed(text), highlight=False, soft_wrap=True, markup=False)


def program() -> str:
    """Name by which the user started the program, `symgen` or `python -m runtime`."""
    return "symgen" if Path(sys.argv[0]).stem == "symgen" else "python -m runtime"


def as_typed(text: str) -> str:
    """A sentence whose commands begin with `symgen` where the user started that."""
    if program() != "symgen":
        return text
    return text.replace("python -m runtime ", "symgen ").replace("python -m symgen ", "symgen ")


def command_line() -> str:
    """Command line as it was typed, for the provenance of result files."""
    return shlex.join([*program().split(), *sys.argv[1:]])


def flowing(doc: str) -> str:
    r"""Help text of a docstring; a paragraph after \b keeps its lines, others are refilled."""
    blocks = doc.split("\n\n")
    return "\n\n".join(
        block.removeprefix("\\b\n") if block.startswith("\\b\n") else " ".join(block.split("\n"))
        for block in blocks
    )


def completing(names: Iterable[str]) -> Callable[[str], list[str]]:
    """Names that a shell offers for an option, for `autocompletion=` of Typer."""

    def fitting(incomplete: str) -> list[str]:
        return sorted(name for name in names if name.startswith(incomplete))

    return fitting
