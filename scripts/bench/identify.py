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
from bench.compiled import interleave, processor, ratio
from bench.doors import Door
from bench.front import Sheet, ratio_text
from runtime.common.threads import one_blas_thread
from runtime.library import Library


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
    samples = len(setting.train)
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
    notes = [f"skipped: {label}: {why}." for label, why in skipped.items()]
    facts = {"robot": lib.name, "level": lib.level, "processor": processor(), "rounds": rounds}
    facts |= {"samples": samples, "rows": rows, "skipped": skipped}
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
