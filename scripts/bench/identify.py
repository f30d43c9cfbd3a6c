"""The run behind `scripts/bench_identify`: a registry of measurements, one table.

An entry names the C function behind it. Where the library has none, the entry is skipped and says
so; a new function needs one more entry in `ENTRIES` and nothing else.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench import doors
from bench.batch import make_batch
from bench.compiled import burst, interleave, limits, processor, ratio
from bench.doors import Door
from bench.front import BenchError, Sheet, ratio_text
from bench.ours import Ours
from runtime.common.threads import one_blas_thread
from runtime.library import Library
from symgen.emit.programs import eliminate


@dataclass(frozen=True, slots=True)
class Entry:
    """One quantity; its name in JSON is that of the function `ours`."""

    label: str  # of it in tables
    needs: str  # C function of the level, without robot and level
    ours: Door  # makes what returns s per unit
    numpy: Door | None = None
    document: float | None = None  # seconds in the document, None where it states none
    once: bool = False  # too long for rounds: measured once, NumPy not at all


_TRIALS = f"{doors.TRIALS} trials, ideal case, p = {doors.PERTURBATION}"
_COST, _EXACT = "excitation_cost", "statistics, rows eliminated, per sample"
_WHOLE, _FALL = f"MAP from {doors.SAMPLES} samples", "log-Cholesky–Levenberg, error to 1/1000"
_FULL, _BATCH = "Adam iteration, all samples", "Adam iteration, mini-batch of 64"
_BOTH = "excitation, value and gradient"
ENTRIES = (
    Entry("statistics, per sample", "statistics", doors.statistics, doors.numpy_statistics),
    Entry(_EXACT, "statistics", doors.statistics_of_exact),
    Entry(_FULL, "adam", doors.adam_full, doors.numpy_adam_full),
    Entry(_BATCH, "adam", doors.adam_batch, doors.numpy_adam_batch, document=75e-3),
    Entry("Levenberg–Marquardt step", "levenberg", doors.levenberg, doors.numpy_levenberg),
    Entry("MAP, compressed data", "convex", doors.most_probable),
    Entry("PC-IDIM-OLS path, compressed data", "convex", doors.path, document=78.0),
    Entry(_FALL, "levenberg", doors.log_cholesky),
    Entry(_WHOLE, "convex", doors.identified, document=33.0),
    Entry("excitation, value", _COST, doors.excitation_value, doors.numpy_excitation_value),
    Entry(_BOTH, _COST, doors.excitation_gradient, doors.numpy_excitation_gradient),
    Entry(_TRIALS, "adam", doors.monte_carlo, document=doors.TRIALS * 57.0, once=True),
)


@one_blas_thread
def measure(lib: Library, rounds: int, trials: bool, report: Callable[[str], None]) -> Sheet:
    """Time every entry that the library has functions for."""
    setting, skipped, rows = doors.setting(lib), dict[str, str](), list[dict[str, Any]]()
    has = _functions(lib)
    for entry in ENTRIES:
        why = _refusal(entry, lib, has, trials)
        if why is None:
            report(f"{entry.label} ...")
            rows.append(_measured(entry, setting, rounds))
        else:
            skipped[entry.label] = why
    passes, samples = passes_of(setting, rounds), len(setting.train)
    title = f"{lib.name}: identification and excitation, {lib.level}, {processor()}"
    caption = (
        f"Through the functions of runtime, one thread; {samples} training samples; the "
        f"best of each of {rounds} interleaved rounds, medians over the rounds, ratios "
        "within a round; trials once. NumPy: stored Y_b, products and steps in NumPy, "
        "excitation gradient by differences. Document: its own times on its machine."
    )
    lines = [
        (
            row["label"],
            _time(row["seconds"]),
            *(_time(row["numpy"]), ratio_text(row["numpy_ratio"])),
            *(_time(row["document"]), ratio_text(row["document_ratio"])),
        )
        for row in rows
    ]
    head = ("work", "time", "NumPy", "NumPy / ours", "document", "document / ours")
    notes = [*(f"skipped: {label}: {why}." for label, why in skipped.items()), sentence(passes)]
    facts = {"robot": lib.name, "level": lib.level, "processor": processor(), "rounds": rounds}
    facts |= {"samples": samples, "rows": rows, "skipped": skipped, "passes": passes}
    return Sheet("bench_identify", head, lines, facts, title, caption, notes)


def _functions(lib: Library) -> Callable[[str], bool]:
    dll = ctypes.CDLL(str((Path(lib.folder) / f"lib{lib.name}.so").resolve()))
    return lambda name: hasattr(dll, f"{lib.name}_{lib.level}_{name}")


def _refusal(entry: Entry, lib: Library, has: Callable[[str], bool], trials: bool) -> str | None:
    if not has(entry.needs):
        return f"the level '{lib.level}' of '{lib.name}' has no function '{entry.needs}'"
    return "not requested (--no-trials)" if entry.once and not trials else None


def _measured(entry: Entry, setting: doors.Setting, rounds: int) -> dict[str, Any]:
    """Seconds of one unit; a ratio says how many times longer the other takes."""
    ours, numpy, times = entry.ours(setting), None, None
    if entry.once:
        seconds = ours()
    else:
        contenders = {"ours": ours}
        if entry.numpy is not None:
            contenders["numpy"] = entry.numpy(setting)
        times_of = interleave(contenders, rounds)
        seconds = float(np.median(times_of["ours"]))
        if "numpy" in times_of:
            numpy = float(np.median(times_of["numpy"]))
            times = ratio(times_of["numpy"], times_of["ours"])
    row = {"name": entry.ours.__name__, "label": entry.label, "seconds": seconds, "numpy": numpy}
    of_document = None if entry.document is None else entry.document / seconds
    return row | {"numpy_ratio": times, "document": entry.document, "document_ratio": of_document}


def _time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}" if seconds < 1e3 else f"{seconds:.0f} s"
    return f"{seconds * 1e9:.3g} ns"


TILES = 512  # samples whose Y_b stays in the second cache
SHORT = 2e-3
"""Seconds of a measurement: as short as that of the limit, which other work disturbs less."""


def passes_of(setting: doors.Setting, rounds: int) -> dict[str, float]:
    """The pass over the rows [Y_b τ] beside the limit of multiply-adds of a core, in s per sample.

    A Cholesky pass multiplies the rows: RᵀR = AᵀA, the upper half. Householder reflections of the
    same rows take 1.94 times as many multiply-adds on an FR3.
    """
    lib = setting.lib
    products, elimination = multiply_adds(lib)
    tiles = Ours(lib, ("base_regressor",)).contender(
        "base_regressor", lib.level, "tiles", make_batch(lib, TILES)
    )
    if tiles is None:
        raise BenchError(f"the level '{lib.level}' of '{lib.name}' has no Y_b on tiles")
    contenders: dict[str, Callable[[], float]] = {
        "limit": limits((lib.level,))[lib.level],
        "rows": burst(tiles.run, TILES),
        "statistics": doors.statistics(setting, SHORT),
        "eliminated": doors.statistics_of_exact(setting, SHORT),
    }
    times = {name: np.asarray(values) for name, values in interleave(contenders, rounds).items()}
    limit, rows = 2e-9 * products * times["limit"], 1e-9 * times["rows"]

    def share(name: str) -> float:
        return float(np.median(limit / (times[name] - rows)))

    return {
        "products": products,
        "elimination": elimination,
        "limit": float(np.median(limit)),
        "rows": float(np.median(rows)),
        "share": share("statistics"),
        "share_eliminated": share("eliminated"),
        "share_of_all": float(np.median(limit / times["statistics"])),
    }


def sentence(passes: dict[str, float]) -> str:
    """One line for the end of a table."""
    return (
        "Statistics: a Cholesky pass over the rows takes {products} multiply-adds "
        "({limit:.0f} ns at the limit), an elimination {elimination}; without Y_b ({rows:.0f} ns) "
        "the statistics reach {share:.2f} of the limit of the former, {share_eliminated:.2f} where "
        "all rows are eliminated, and with Y_b {share_of_all:.2f}."
    ).format_map(passes | {key: 1e9 * passes[key] for key in ("limit", "rows")})


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
