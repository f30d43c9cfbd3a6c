"""`symgen rerun` and `symgen undo`: a result again, and the one that the last run replaced."""

import io
import math
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from runtime.cli.common import EARLIER, Yes, swap_earlier
from runtime.common.commands import GROUPS, imported
from runtime.common.files import bytes_of, json_of, toml_of
from runtime.common.settings import FILE, Choices, argument_field, settings_place
from runtime.common.terminal import say
from runtime.errors import RuntimeFault

PROVENANCE = {"command", "created", "date", "seconds", "versions", "wall_s", "cpu_s", "provenance"}
"""Keys of a document on when, where and how long, which differ between runs."""
DIFFERENT = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class RerunSettings(Choices):
    """Settings of `symgen rerun`."""

    options = ""
    result: Path = argument_field(metavar="RESULT", help=f"Folder or file with a {FILE} beside it.")
    yes: Yes = False


def rerun_command(given: RerunSettings) -> None:
    r"""Repeat the run of a result and compare the digits.

    \b
    symgen identify fr3_simulated --out results/first
    symgen rerun results/first

    Run from the folder of the first run, because paths of logs count from there. Nothing is
    replaced. Compared are all numbers of the JSON files, without dates, versions and times, and
    all bytes of CSV and TOML files. Exit code 1: digits differ.
    """
    settings = given.result if given.result.name.endswith(FILE) else settings_place(given.result)
    if not settings.is_file():
        raise RuntimeFault(
            f"rerun expects a result with its settings, and there is no '{settings}'; give the "
            f"folder or file of a result that was written with a {FILE}"
        )
    name = str(toml_of(settings).get("command"))
    listed = {each.name: each for group in GROUPS.values() for each in group}
    if name not in listed or name == "rerun":
        raise RuntimeFault(f"'{settings}' expects the key command of a command, got '{name}'")
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / given.result.name
        words = ["--settings", str(settings), "--out", str(again)]
        if given.yes:
            words += ["--settings", "yes=true"]
        with redirect_stdout(io.StringIO()):
            imported(listed[name]).main(words, standalone_mode=False)
        pairs = list(_pairs(given.result, again))
        faults: list[str] = []
        for one, other in pairs:
            if one.suffix == ".json":
                faults += _unequal(json_of(one), json_of(other), one.name)
            elif bytes_of(one) != bytes_of(other):
                faults.append(f"{one.name} has other bytes")
    names = ", ".join(first.name for first, _ in pairs)
    if not faults:
        say(f"same digits: {names}")
        return
    size = f"; {len(faults)} values differ" if len(faults) > 1 else ""
    say(f"different digits: {faults[0]}{size}")
    raise typer.Exit(DIFFERENT)


def _pairs(first: Path, again: Path) -> Iterator[tuple[Path, Path]]:
    if first.is_file():
        yield first, again
        return
    for path in sorted(again.iterdir()):
        if path.suffix in {".json", ".csv", ".toml"} and path.name != FILE:
            yield first / path.name, path


def _unequal(first: Any, again: Any, place: str) -> Iterator[str]:
    if isinstance(first, dict) and isinstance(again, dict):
        for key in {*first, *again} - PROVENANCE:
            yield from _unequal(first.get(key), again.get(key), f"{place} {key}")
    elif isinstance(first, list) and isinstance(again, list) and len(first) == len(again):
        for k, both in enumerate(zip(first, again, strict=True)):
            yield from _unequal(*both, f"{place}[{k}]")
    elif first != again and not all(isinstance(x, float) and math.isnan(x) for x in (first, again)):
        yield f"{place} was {first!r}, is {again!r}"


@dataclass(frozen=True, slots=True, kw_only=True)
class UndoSettings(Choices):
    """Settings of `symgen undo`."""

    options = ""
    result: Path = argument_field(metavar="RESULT", help="Folder whose result was replaced.")


def undo_command(given: UndoSettings) -> None:
    r"""Bring the result back that the last run replaced.

    \b
    symgen undo results/fr3_simulated-map

    A command that replaces its earlier result keeps that one in the hidden folder .earlier of the
    result. A second undo brings the newer result back.
    """
    if not (given.result / EARLIER).is_dir():
        raise RuntimeFault(
            f"expected a folder whose result was replaced, got '{given.result}', which keeps no "
            "earlier one"
        )
    for name in swap_earlier(given.result):
        say(f"back: {given.result / name}")
