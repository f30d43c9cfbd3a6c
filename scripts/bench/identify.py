"""The run behind `scripts/bench_identify`: a registry of measurements, one table.

An entry names the C function behind it. Where the library has none, the entry is skipped and says
so; a new function needs one more entry in `ENTRIES` and nothing else.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import doors
from bench.batch import make_batch
from bench.compiled import burst, find, interleave, limits, processor, ratio
from bench.doors import Setting
from bench.front import BenchError, Sheet
from bench.ours import Ours
from runtime.common.threads import one_blas_thread
from runtime.library import Library
from symgen.emit.programs import eliminate


@dataclass(frozen=True, slots=True)
class Entry:
    """One quantity."""

    name: str  # of it in JSON
    label: str  # of it in tables
    needs: str  # C function of the level, without robot and level
    ours: Callable[[Setting], Callable[[], float]]  # makes what returns s per unit
    numpy: Callable[[Setting], Callable[[], float]] | None
    document: float | None = None  # seconds in the document, None where it states none
    once: bool = False  # too long for rounds: measured once, NumPy not at all


ENTRIES = (
    Entry(
        "statistics",
        "statistics, per sample",
        "statistics",
        doors.statistics,
        doors.numpy_statistics,
    ),
    Entry(
        "statistics_of_exact",
        "statistics, rows eliminated, per sample",
        "statistics",
        doors.statistics_of_exact,
        None,
    ),
    Entry(
        "adam_full", "Adam iteration, all samples", "adam", doors.adam_full, doors.numpy_adam_full
    ),
    Entry(
        "adam_batch",
        "Adam iteration, mini-batch of 64",
        "adam",
        doors.adam_batch,
        doors.numpy_adam_batch,
        document=75e-3,
    ),
    Entry(
        "levenberg", "Levenberg–Marquardt step", "levenberg", doors.levenberg, doors.numpy_levenberg
    ),
    Entry("map", "MAP, compressed data", "convex", doors.most_probable, None),
    Entry("path", "PC-IDIM-OLS path, compressed data", "convex", doors.path, None, document=78.0),
    Entry(
        "log_cholesky",
        "log-Cholesky–Levenberg, error to 1/1000",
        "levenberg",
        doors.log_cholesky,
        None,
    ),
    Entry(
        "identified",
        f"MAP from {doors.SAMPLES} samples",
        "convex",
        doors.identified,
        None,
        document=33.0,
    ),
    Entry(
        "excitation_value",
        "excitation, value",
        "excitation_cost",
        doors.excitation_value,
        doors.numpy_excitation_value,
    ),
    Entry(
        "excitation_gradient",
        "excitation, value and gradient",
        "excitation_cost",
        doors.excitation_gradient,
        doors.numpy_excitation_gradient,
    ),
    Entry(
        "monte_carlo",
        f"{doors.TRIALS} trials, ideal case, p = {doors.PERTURBATION}",
        "adam",
        doors.monte_carlo,
        None,
        document=doors.TRIALS * 57.0,
        once=True,
    ),
)


@dataclass(frozen=True, slots=True)
class Row:
    """Seconds of one unit; a ratio says how many times longer the other takes."""

    name: str
    label: str
    seconds: float
    numpy: float | None
    numpy_ratio: float | None
    document: float | None
    document_ratio: float | None


@dataclass(frozen=True, slots=True)
class Passes:
    """Seconds per sample; shares are medians of rounds."""

    products: int  # multiply-adds of a Cholesky pass
    elimination: int  # multiply-adds of Householder reflections
    limit: float  # of the multiply-adds of a Cholesky pass on one core
    rows: float  # of Y_b on tiles
    share: float  # of the limit in the statistics without the time of Y_b
    share_eliminated: float  # the same, where all rows are eliminated
    share_of_all: float  # of the limit in the whole time of the statistics


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that one run measured."""

    robot: str
    level: str
    processor: str
    rounds: int
    samples: int
    rows: tuple[Row, ...]
    skipped: dict[str, str]  # label → why
    passes: Passes  # the pass over the rows beside the limit of multiply-adds


@one_blas_thread
def measure(lib: Library, rounds: int, trials: bool, report: Callable[[str], None]) -> Report:
    """Time every entry that the library has functions for."""
    setting, skipped, rows = doors.setting(lib), dict[str, str](), list[Row]()
    has = _functions(lib)
    for entry in ENTRIES:
        why = _refusal(entry, lib, has, trials)
        if why is None:
            report(f"{entry.label} ...")
            rows.append(_measured(entry, setting, rounds))
        else:
            skipped[entry.label] = why
    return Report(
        lib.name,
        lib.level,
        processor(),
        rounds,
        len(setting.train),
        tuple(rows),
        skipped,
        passes_of(setting, rounds),
    )


def _functions(lib: Library) -> Callable[[str], bool]:
    dll = ctypes.CDLL(str((Path(lib.folder) / f"lib{lib.name}.so").resolve()))
    return lambda name: hasattr(dll, f"{lib.name}_{lib.level}_{name}")


def _refusal(entry: Entry, lib: Library, has: Callable[[str], bool], trials: bool) -> str | None:
    if not has(entry.needs):
        return f"the level '{lib.level}' of '{lib.name}' has no function '{entry.needs}'"
    return "not requested (--no-trials)" if entry.once and not trials else None


def _measured(entry: Entry, setting: Setting, rounds: int) -> Row:
    ours = entry.ours(setting)
    numpy, times = None, None
    if entry.once:
        seconds = ours()
    else:
        contenders = {"ours": ours}
        if entry.numpy is not None:
            contenders["numpy"] = entry.numpy(setting)
        times_of = interleave(contenders, rounds)
        seconds = float(np.median(times_of["ours"]))
        if "numpy" in times_of:
            numpy, times = (
                float(np.median(times_of["numpy"])),
                ratio(times_of["numpy"], times_of["ours"]),
            )
    document = entry.document
    return Row(
        entry.name,
        entry.label,
        seconds,
        numpy,
        times,
        document,
        None if document is None else document / seconds,
    )


_HEAD = ("work", "time", "NumPy", "NumPy / ours", "document", "document / ours")


def sheet(report: Report) -> Sheet:
    """One line per entry."""
    title = f"{report.robot}: identification and excitation, {report.level}, {report.processor}"
    caption = (
        f"Through the functions of runtime, one thread; {report.samples} training samples; the "
        f"best of each of {report.rounds} interleaved rounds, medians over the rounds, ratios "
        "within a round; trials once. NumPy: stored Y_b, products and steps in NumPy, "
        "excitation gradient by differences. Document: its own times on its machine."
    )
    lines = [
        (
            row.label,
            _time(row.seconds),
            *(_time(row.numpy), _times(row.numpy_ratio)),
            *(_time(row.document), _times(row.document_ratio)),
        )
        for row in report.rows
    ]
    notes = [f"skipped: {label}: {why}." for label, why in report.skipped.items()]
    notes.append(sentence(report.passes))
    return Sheet("bench_identify", _HEAD, lines, report, title, caption, notes)


def _time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}" if seconds < 1e3 else f"{seconds:.0f} s"
    return f"{seconds * 1e9:.3g} ns"


def _times(value: float | None) -> str:
    return "" if value is None else f"{value:.{1 if value < 10 else 0}f}×"


TILES = 512
"""Samples whose Y_b stays in the second cache."""
SHORT = 2e-3
"""Seconds of a measurement: as short as that of the limit, which other work disturbs less."""


def passes_of(setting: doors.Setting, rounds: int) -> Passes:
    """Time limit, Y_b and statistics in the same rounds."""
    lib = setting.lib
    compiler = find(("cc", "gcc", "clang"))
    products, elimination = multiply_adds(lib)
    tiles = Ours(lib, ("base_regressor",), compiler).contender(
        "base_regressor", lib.level, "tiles", make_batch(lib, TILES)
    )
    if tiles is None:
        raise BenchError(f"the level '{lib.level}' of '{lib.name}' has no Y_b on tiles")
    contenders: dict[str, Callable[[], float]] = {
        "limit": limits(compiler, (lib.level,))[lib.level],
        "rows": burst(tiles.run, TILES),
        "statistics": doors.statistics(setting, SHORT),
        "eliminated": doors.statistics_of_exact(setting, SHORT),
    }
    times = {name: np.asarray(values) for name, values in interleave(contenders, rounds).items()}
    limit, rows = 2e-9 * products * times["limit"], 1e-9 * times["rows"]

    def share(name: str) -> float:
        return float(np.median(limit / (times[name] - rows)))

    return Passes(
        products,
        elimination,
        float(np.median(limit)),
        float(np.median(rows)),
        share("statistics"),
        share("eliminated"),
        float(np.median(limit / times["statistics"])),
    )


def sentence(passes: Passes) -> str:
    """One line for the end of a table."""
    return (
        f"Statistics: a Cholesky pass over the rows takes {passes.products} multiply-adds "
        f"({passes.limit * 1e9:.0f} ns at the limit), an elimination {passes.elimination}; without "
        f"Y_b ({passes.rows * 1e9:.0f} ns) the statistics reach {passes.share:.2f} of the limit of "
        f"the former, {passes.share_eliminated:.2f} where all rows are eliminated, and with Y_b "
        f"{passes.share_of_all:.2f}."
    )


def multiply_adds(lib: Library) -> tuple[int, int]:
    """Multiply-adds per sample, counted from the entries of Y_b that are not zero by structure."""
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 16, lib.n_joints))
    filled = np.abs(lib.base_regressor(q, dq, ddq)).max(axis=0) > 0
    pattern = [[*map(bool, row), True] for row in filled]
    sizes = np.sum(pattern, axis=1)
    # A column takes its length, and two passes over each column to its right.
    elimination = sum(
        len(panel.rows) * (1 + 2 * (panel.width - 1 - i + len(panel.columns)))
        for panel in eliminate(pattern, len(pattern[0]) - 1)
        for i in range(panel.width)
    )
    return int(np.sum(sizes * (sizes + 1) // 2)), elimination
