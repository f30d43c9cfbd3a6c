"""Parent process: starts children, restarts one that dies or hangs, and counts by kind."""

import json
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from rich.table import Table

ROOT = Path(__file__).parents[2]
SILENCE = 600.0  # time without a line after which a child counts as hanging, s


@dataclass(frozen=True, slots=True)
class Row:
    """How one file ended: read, refused, or the fault of its reader."""

    index: int
    outcome: str
    seconds: float = 0.0
    grown: int = 0

    @property
    def is_fault(self) -> bool:
        """Neither read nor refused."""
        return self.outcome not in {"read", "refused"}


Step = Callable[[str, Row | None], None]


@dataclass(slots=True)
class Tally:
    """Outcomes of one kind of file."""

    rows: list[Row] = field(default_factory=list)

    @property
    def files(self) -> int:
        """Number of files."""
        return len(self.rows)

    @property
    def refused(self) -> int:
        """Number of files that were refused."""
        return sum(row.outcome == "refused" for row in self.rows)

    @property
    def faults(self) -> list[Row]:
        """Files whose reader is at fault."""
        return [row for row in self.rows if row.is_fault]


def fuzz(
    kinds: Sequence[str],
    count: int,
    seed: int,
    robot: Path,
    step: Step = lambda kind, fault: None,
    first: int = 0,
    keep: Path | None = None,
) -> dict[str, Tally]:
    """Read damaged files, equally many of every kind; `step` hears of each and of its fault."""
    tallies = {kind: Tally() for kind in kinds}
    job: dict[str, Any] = {"robot": str(robot), "seed": seed, "keep": keep and str(keep)}
    with tempfile.TemporaryDirectory(prefix="fuzz.") as folder, suppress(KeyboardInterrupt):
        while work := [
            (kind, first + tally.files, count - tally.files)
            for kind, tally in tallies.items()
            if count > tally.files
        ]:
            _one_child(job | {"folder": folder, "work": work}, tallies, step)
    return tallies


def _one_child(job: dict[str, Any], tallies: dict[str, Tally], step: Step) -> None:
    """Run a child to its end or its death."""
    begun: tuple[str, int] | None = None
    end = ""
    with (
        tempfile.TemporaryFile() as complaint,
        subprocess.Popen(
            [sys.executable, "-m", "scripts.fuzzing.child", json.dumps(job)],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=complaint,
        ) as child,
    ):
        assert child.stdout is not None  # noqa: S101  it is a pipe
        try:
            for facts in _lines(child.stdout):
                begun = facts.pop("begin", None)
                if begun is None:
                    _add(tallies, facts.pop("kind"), Row(**facts), step)
        except TimeoutError:
            child.kill()
            end = f"hangs outside Python, silent for {SILENCE:g} s"
        code = child.wait()
        complaint.seek(0)
        said = complaint.read().decode(errors="replace")[-800:]
    if begun is not None:
        kind, index = begun
        outcome = f"{end or f'kills the process ({code})'}\n{said}"
        _add(tallies, kind, Row(index, outcome), step)
    elif code:
        raise RuntimeError(f"the child of the fuzzer failed by itself:\n{said}")


def _lines(stream: IO[bytes]) -> Iterator[dict[str, Any]]:
    """JSON lines until the end of the stream."""
    buffer = b""
    while select.select([stream], [], [], SILENCE)[0]:
        data = os.read(stream.fileno(), 65536)
        if not data:
            return
        *whole, buffer = (buffer + data).split(b"\n")
        yield from map(json.loads, whole)
    raise TimeoutError


def _add(tallies: dict[str, Tally], kind: str, row: Row, step: Step) -> None:
    tallies[kind].rows.append(row)
    step(kind, row if row.is_fault else None)


def table(tallies: dict[str, Tally]) -> Table:
    """One row per kind."""
    shown = Table("kind", title="damaged files")
    for head in ("files", "read", "refused", "faults", "CPU s", "slowest ms", "memory MB"):
        shown.add_column(head, justify="right")
    whole = Tally([row for tally in tallies.values() for row in tally.rows])
    for kind, tally in (*tallies.items(), ("all", whole)):
        read = tally.files - tally.refused - len(tally.faults)
        counts = (tally.files, read, tally.refused, len(tally.faults))
        seconds = [row.seconds for row in tally.rows] or [0.0]
        grown = max((row.grown for row in tally.rows), default=0)
        used = (f"{sum(seconds):.1f}", f"{1e3 * max(seconds):.0f}", f"{grown / 1e6:.0f}")
        shown.add_row(kind, *map(str, counts), *used, end_section=kind == [*tallies][-1])
    return shown
