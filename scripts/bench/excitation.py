"""The run behind `scripts/bench_excitation`: the document's problem by several optimisers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bench import excitation_peers as peers
from bench.compiled import processor
from bench.excitation_peers import Start
from bench.front import BenchError, Sheet
from runtime.common.threads import one_blas_thread
from runtime.excitation import COST_SAMPLES
from runtime.excitation.search.design_settings import SearchProblem
from runtime.library import Library

DOCUMENT = 5.4178
"""Condition number that the document reached (Sec. 3.4.2)."""
DOCUMENT_SECONDS = 9 * 3600.0
"""Least time of one run of 50 iterations in the document."""
OPTIMISERS = (
    ("ours", "D-opt → Schatten → semidefinite polish", peers.ours),
    ("staged", "SLSQP, our stages and exact gradient", peers.slsqp_staged),
    ("slsqp", "SLSQP, our exact gradient", peers.slsqp_exact),
    ("differences", "SLSQP, differences on Pinocchio", peers.slsqp_differences),
)


@dataclass(frozen=True, slots=True)
class Row:
    """All starts of one optimiser, one process."""

    name: str  # in JSON
    label: str  # in tables
    starts: tuple[Start, ...]

    @property
    def conditions(self) -> tuple[float, float, float]:
        """Best, median and worst condition number."""
        result = [start.condition for start in self.starts]
        return min(result), float(np.median(result)), max(result)

    @property
    def seconds(self) -> tuple[float, float]:
        """Median processor and wall time of a start."""
        cpu, wall = ([getattr(s, kind) for s in self.starts] for kind in ("cpu", "wall"))
        return float(np.median(cpu)), float(np.median(wall))

    @property
    def beats_document(self) -> float | None:
        """Wall time until the first start, in order, that is better than the document."""
        passed = 0.0
        for start in self.starts:
            passed += start.wall
            if start.condition < DOCUMENT:
                return passed
        return None


@dataclass(frozen=True, slots=True)
class Report:
    """Measurements of one run."""

    robot: str
    level: str
    processor: str
    duration: float
    harmonics: int
    rows: tuple[Row, ...]
    skipped: dict[str, str]


@one_blas_thread
def measure(
    lib: Library,
    starts: int,
    duration: float,
    harmonics: int,
    seed: int,
    report: Callable[[str], None],
) -> Report:
    """Run every optimiser from the same random motions, one start after another."""
    problem = SearchProblem(lib.folder, lib.level, lib.home, harmonics, duration, seed)
    rows, skipped = list[Row](), dict[str, str]()
    for name, label, make in OPTIMISERS:
        try:
            work = make(lib, problem)
        except BenchError as error:
            skipped[label] = str(error)
            continue
        result = list[Start]()
        for number in range(starts):
            result.append(peers.timed(work, number))
            report(f"{label}: start {number + 1} of {starts}, cond {result[-1].condition:.3f}")
        rows.append(Row(name, label, tuple(result)))
    return Report(lib.name, lib.level, processor(), duration, harmonics, tuple(rows), skipped)


_HEAD = (
    *("optimiser", "starts", "best", "median", "worst", "CPU s / start", "wall s / start"),
    f"wall s to < {DOCUMENT}",
)


def sheet(report: Report) -> Sheet:
    """One line per optimiser and one for the document."""
    title = (
        f"{report.robot}: condition numbers, t_f {report.duration:g} s, M "
        f"{report.harmonics}, {report.level}, {report.processor}"
    )
    caption = (
        f"Column-normalised base regressor at {COST_SAMPLES} samples; position, velocity and "
        "acceleration limits kept at 1 kHz; the same random starts for all, one process. "
        "Document: five starts of 50 iterations, its own machine, t_f not stated."
    )
    notes = [f"skipped: {label}: {why}." for label, why in report.skipped.items()]
    return Sheet("bench_excitation", _HEAD, [*_lines(report)], report, title, caption, notes)


def _lines(report: Report) -> Iterator[tuple[str, ...]]:
    for row in report.rows:
        passed = row.beats_document
        yield (
            row.label,
            str(len(row.starts)),
            *(f"{value:.2f}" for value in row.conditions),
            *(f"{value:.2f}" for value in row.seconds),
            "never" if passed is None else f"{passed:.1f}",
        )
    yield "the document", "5", f"{DOCUMENT}", "", "", "", f"> {DOCUMENT_SECONDS:.0f}", ""
