"""What commands of both packages print: sentences, names of programs, texts of `--help`."""

import re
import shlex
import sys
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Column
from rich.table import Table as RichTable

from runtime.common.tables import Table

console = Console()
VERBOSE: ContextVar[bool] = ContextVar("VERBOSE", default=False)
"""Whether a command prints its details: --verbose, before or behind the command."""
_NUMBER = re.compile(r"[-+−±<>]?\d.*|[-+−]?∞|[-–]?", re.DOTALL)
_WIDEST = 40  # characters of a word that a narrow terminal does not break


def say(text: str) -> None:
    """Print one line to the terminal without markup, with commands as the user types them."""
    console.print(as_typed(text), highlight=False, soft_wrap=True, markup=False)


def say_notes(notes: Iterable[str]) -> None:
    """Print notes, a line each."""
    for note in notes:
        say(f"note: {note}")


def show(table: Table) -> None:
    """Print a table: numbers on the right, no word broken, without borders where it is wide."""
    lines = [row for row in (*table.rows, table.total) if row]
    columns = []
    for k, head in enumerate(table.header):
        cells = [line[k] for line in lines]
        numbers = [bool(_NUMBER.fullmatch(cell)) for cell in cells if cell]
        is_number = k > 0 and 2 * sum(numbers) > len(numbers)
        column = Column(escape(head), justify="right" if is_number else "left")
        column.min_width = min(_WIDEST, max(map(len, " ".join([head, *cells]).split()), default=0))
        columns.append(column)
    widest = sum(column.min_width or 0 for column in columns)
    frame: dict[str, Any] = {}
    if widest + 3 * len(columns) + 1 > console.width:
        frame = {"box": SIMPLE_HEAD, "padding": 0, "pad_edge": False}
    title, note = (escape(text) or None for text in (table.title, table.note))
    shown = RichTable(*columns, title=title, caption=note, **frame)
    for row in table.rows:
        shown.add_row(*map(escape, row))
    if table.total:
        shown.add_section()
        shown.add_row(*map(escape, table.total))
    console.print(shown, crop=False)


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
    return "\n\n".join(
        block.removeprefix("\\b\n") if block.startswith("\\b\n") else " ".join(block.split("\n"))
        for block in doc.split("\n\n")
    )


def completing(names: Iterable[str]) -> Callable[[str], list[str]]:
    """Names that a shell offers for an option, for `autocompletion=` of Typer; one per comma."""

    def fitting(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        taken = before.split(",")
        fit = (name for name in names if name.startswith(last) and name not in taken)
        return sorted(f"{before}{comma}{name}" for name in fit)

    return fitting
