"""The parent: starts children, restarts one that dies or falls silent, and counts by kind."""

import json
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from rich.table import Table

ROOT = Path(__file__).parents[2]
SILENCE = 120.0
"""Seconds without a line after which a child is taken to hang where Python cannot stop it."""


@dataclass(slots=True)
class Tally:
    """What became of the files of one kind."""

    accepted: int = 0
    refused: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    memory: int = 0
    faults: list[tuple[int, str]] = field(default_factory=list)

    @property
    def files(self) -> int:
        """All of them."""
        return self.accepted + self.refused + len(self.faults)


def fuzz(
    kinds: Sequence[str],
    files: int,
    seed: int,
    robot: Path,
    step: Callable[[], None] = lambda: None,
) -> dict[str, Tally]:
    """Read damaged files, equally many of every kind.

    Args:
        kinds: of `doors.DOORS`.
        files: in all.
        seed: the same seed and kind give the same files.
        robot: folder of a compiled robot.
        step: called after every file.
    """
    tallies = {kind: Tally() for kind in kinds}
    share, more = divmod(files, len(kinds))
    wanted = {kind: share + (i < more) for i, kind in enumerate(kinds)}
    with tempfile.TemporaryDirectory(prefix="fuzz.") as folder:
        while work := [
            (kind, tallies[kind].files, count - tallies[kind].files)
            for kind, count in wanted.items()
            if count > tallies[kind].files
        ]:
            job = {"robot": str(robot), "folder": folder, "seed": seed, "work": work}
            _one_child(job, tallies, step)
    return tallies


def _one_child(job: dict[str, Any], tallies: dict[str, Tally], step: Callable[[], None]) -> None:
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
                    _count(tallies[facts["kind"]], facts)
                    step()
        except TimeoutError:
            child.kill()
            end = f"hangs outside Python, silent for {SILENCE:g} s"
        code = child.wait()
        complaint.seek(0)
        said = complaint.read().decode(errors="replace")[-800:]
    if begun is not None:
        kind, index = begun
        tallies[kind].faults.append((index, f"{end or f'kills the process ({code})'}\n{said}"))
        step()
    elif code:
        raise RuntimeError(f"the child of the fuzzer failed by itself:\n{said}")


def _lines(stream: IO[bytes]) -> Iterator[dict[str, Any]]:
    """JSON lines until the end of the stream.

    Raises:
        TimeoutError: it is silent for too long.
    """
    buffer = b""
    while select.select([stream], [], [], SILENCE)[0]:
        data = os.read(stream.fileno(), 65536)
        if not data:
            return
        *whole, buffer = (buffer + data).split(b"\n")
        yield from map(json.loads, whole)
    raise TimeoutError


def _count(tally: Tally, facts: dict[str, Any]) -> None:
    outcome = facts["outcome"]
    if outcome == "accepted":
        tally.accepted += 1
    elif outcome == "refused":
        tally.refused += 1
    else:
        tally.faults.append((facts["index"], outcome))
    tally.seconds += facts["seconds"]
    tally.slowest = max(tally.slowest, facts["seconds"])
    tally.memory = max(tally.memory, facts["grown"])


def table(tallies: dict[str, Tally]) -> Table:
    """One row per kind."""
    shown = Table("kind", title="damaged files")
    for head in ("files", "accepted", "refused", "faults", "CPU s", "slowest ms", "memory MB"):
        shown.add_column(head, justify="right")
    for kind, tally in tallies.items():
        counts = (tally.files, tally.accepted, tally.refused, len(tally.faults))
        shown.add_row(
            kind,
            *map(str, counts),
            f"{tally.seconds:.1f}",
            f"{1e3 * tally.slowest:.0f}",
            f"{tally.memory / 1e6:.0f}",
        )
    return shown
