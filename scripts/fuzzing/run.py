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
from typing import IO, Any, NamedTuple

from rich.table import Table

ROOT = Path(__file__).parents[2]
SILENCE = 600.0
"""Time without a line after which a child counts as hanging, s."""


class Fault(NamedTuple):
    """Index of a file, and the fault of its reader."""

    index: int
    outcome: str


Step = Callable[[str, Fault | None], None]


@dataclass(slots=True)
class Tally:
    """Counts of outcomes of one kind of file."""

    read: int = 0
    refused: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    memory: int = 0
    faults: list[Fault] = field(default_factory=list)

    @property
    def files(self) -> int:
        """Number of files."""
        return self.read + self.refused + len(self.faults)

    def add(self, other: "Tally") -> None:
        """Add the counts of another kind."""
        self.read += other.read
        self.refused += other.refused
        self.faults += other.faults
        self.seconds += other.seconds
        self.slowest = max(self.slowest, other.slowest)
        self.memory = max(self.memory, other.memory)


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
                begun = facts.get("begin")
                if begun is None:
                    step(facts["kind"], _count(tallies[facts["kind"]], facts))
        except TimeoutError:
            child.kill()
            end = f"hangs outside Python, silent for {SILENCE:g} s"
        code = child.wait()
        complaint.seek(0)
        said = complaint.read().decode(errors="replace")[-800:]
    if begun is not None:
        kind, index = begun
        fault = Fault(index, f"{end or f'kills the process ({code})'}\n{said}")
        tallies[kind].faults.append(fault)
        step(kind, fault)
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


def _count(tally: Tally, facts: dict[str, Any]) -> Fault | None:
    outcome, fault = facts["outcome"], None
    if outcome == "read":
        tally.read += 1
    elif outcome == "refused":
        tally.refused += 1
    else:
        fault = Fault(facts["index"], outcome)
        tally.faults.append(fault)
    tally.seconds += facts["seconds"]
    tally.slowest = max(tally.slowest, facts["seconds"])
    tally.memory = max(tally.memory, facts["grown"])
    return fault


def table(tallies: dict[str, Tally]) -> Table:
    """One row per kind."""
    whole = Tally()
    shown = Table("kind", title="damaged files")
    for head in ("files", "read", "refused", "faults", "CPU s", "slowest ms", "memory MB"):
        shown.add_column(head, justify="right")
    for kind, tally in (*tallies.items(), ("all", whole)):
        if tally is whole:
            shown.add_section()
        else:
            whole.add(tally)
        counts = (tally.files, tally.read, tally.refused, len(tally.faults))
        shown.add_row(
            kind,
            *map(str, counts),
            f"{tally.seconds:.1f}",
            f"{1e3 * tally.slowest:.0f}",
            f"{tally.memory / 1e6:.0f}",
        )
    return shown
