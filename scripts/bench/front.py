"""What scripts share: options, tables for the terminal, for --json and for the pages of docs."""

import argparse
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from string import Formatter
from typing import Any

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[2]
DESIGNS, MOTION, SHORT = (
    Path(__file__).with_name(f"fr3_{name}.json") for name in ("trials", "motion", "short")
)
"""Motions that `excite` designed for the FR3: several of 10 s, one of 20 s, one of 3 s."""


class BenchError(Exception):
    """A benchmark, or one peer of it, cannot run here; the message says why."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table of texts."""

    name: str  # of its marks <!-- name --> and <!-- /name --> in the pages
    head: Sequence[str]
    lines: Iterable[Sequence[str]]
    facts: Any = None  # for --json, data classes among them
    title: str = ""
    caption: str = ""
    notes: Sequence[str] = ()  # below the table in the terminal
    below: str = ""  # below the table in the pages

    def shown(self) -> Table:
        """The table for a terminal, all columns but the first at the right."""
        table = Table(title=self.title or None, caption=self.caption or None)
        for number, head in enumerate(self.head):
            table.add_column(head, justify="right" if number else "left")
        for cells in self.lines:
            table.add_row(*cells)
        return table

    def markdown(self) -> str:
        """The table for a page."""
        return "\n".join([markdown(self.head, self.lines), *filter(None, [self.below])])


class _Cells(Formatter):
    """Formats of cells; one without a value is empty."""

    def format_field(self, value: Any, spec: str) -> str:
        return "" if value is None else super().format_field(value, spec)


def sheet_of(name: str, columns: dict[str, str], rows: Sequence[Any], **more: Any) -> Sheet:
    """Table of rows by heads and formats: of sequences in this order, `{key:.1f}` of records."""
    cells, lines, plain = _Cells(), [], []
    for row in rows:
        is_sequence = isinstance(row, tuple | list)
        known = dict(zip(columns, row, strict=True)) if is_sequence else row
        plain.append(known if isinstance(known, Mapping) else asdict(known))
        if is_sequence:
            pairs = zip(row, columns.values(), strict=True)
            lines.append([cells.format_field(value, form) for value, form in pairs])
        else:
            lines.append([cells.vformat(form, (), plain[-1]) for form in columns.values()])
    return Sheet(name, [*columns], lines, **{"facts": plain} | more)


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Table as Markdown."""
    rows = [f"| {' | '.join(cells)} |" for cells in (head, *lines)]
    return "\n".join((rows[0], "|---" * len(head) + "|", *rows[1:]))


def merged(before: str, after: str, keys: int) -> str:
    """Markdown table with rows of another one for those of the same `keys` first cells, or more."""
    head, rule, *rows = before.splitlines()
    cells = {tuple(row.split("|")[1 : 1 + keys]): row for row in (*rows, *after.splitlines()[2:])}
    return "\n".join((head, rule, *cells.values()))


PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


def update(name: str, text: str) -> None:
    """Write a text between the marks <!-- name --> and <!-- /name --> of every page."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    marked = [page for page in PAGES if start in page.read_text(encoding="utf-8")]
    if not marked:
        raise ValueError(f"expected a page with {start}, got none; put the marks into a page")
    for page in marked:
        before, rest = page.read_text(encoding="utf-8").split(start)
        _, after = rest.split(end)
        page.write_text(f"{before}{start}\n{text}\n{end}{after}", encoding="utf-8")


def table_of(name: str) -> str:
    """Text between the marks of the first page that has them."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        if start in text:
            return text.split(start)[1].split(end)[0].strip()
    raise ValueError(f"expected a page with {start}, got none; put the marks into a page")


def options(doc: str | None, pages: bool = True) -> argparse.ArgumentParser:
    """The options --json and, of tables that pages have, --update."""
    parser = argparse.ArgumentParser(description=doc)
    if pages:
        parser.add_argument("--update", action="store_true", help="write the table of the pages")
    parser.add_argument("--json", action="store_true", help="machine-readable results only")
    return parser


def show(given: argparse.Namespace, *sheets: Sheet, keys: int = 0) -> int:
    """Update the pages where asked; print the tables or, with --json, the facts of the sheets.

    With `keys` a table of a page keeps the rows whose so many first cells are of no new row.
    """
    for sheet in sheets if getattr(given, "update", False) else ():
        text = sheet.markdown()
        update(sheet.name, merged(table_of(sheet.name), text, keys) if keys else text)
    if given.json:
        facts = [sheet.facts for sheet in sheets]
        whole = facts[0] if len(facts) == 1 else facts
        print(json.dumps(whole, indent=1, ensure_ascii=False, default=asdict))
        return 0
    console = Console(width=None if sys.stdout.isatty() else 160)
    for sheet in sheets:
        console.print(sheet.shown())
        for line in (*sheet.notes, *sheet.below.splitlines()):
            console.print(line, highlight=False, soft_wrap=True, markup=False)
    return 0


def run(main: Callable[[], int | None]) -> None:
    """Exit with the code of a script; what it cannot do is one sentence and code 2."""
    from runtime.errors import RuntimeFault
    from symgen.errors import SymgenError

    try:
        code = main()
    except (BenchError, RuntimeFault, SymgenError) as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        code = 2
    raise SystemExit(code)


def tell(line: str) -> None:
    """Progress, apart from what is measured."""
    print(line, file=sys.stderr, flush=True)


def python(
    *words: object, folder: Path | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run an interpreter that finds this checkout, with further variables of the environment."""
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"PYTHONPATH": paths} | variables
    command = [sys.executable, *map(str, words)]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def ratio_text(value: float | None) -> str:
    """How many times longer a peer takes; empty without one."""
    return "" if value is None else f"{value:.{1 if value < 10 else 0}f}×"


def cpu_seconds() -> float:
    """CPU time of this process and of those that it has waited for [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def peak_memory() -> int:
    """Bytes of the peak resident set of this process."""
    status = Path("/proc/self/status")
    if not status.exists():  # macOS; on Linux getrusage starts at the peak of the parent
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    lines = status.read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def shared(needs: str = "models") -> Path:
    """Folder of published robots and logs."""
    folder = Path(os.environ.get("SYMGEN_DATA", ROOT.parent / "shared"))
    if not (folder / needs).is_dir():
        raise BenchError(f"no {needs}/ in '{folder}'; set SYMGEN_DATA")
    return folder
