"""`compare.json` → a page, or sections of a page, that compare the methods; and two results."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.common.files import json_of
from runtime.common.tables import Table, significant
from runtime.errors import RuntimeFault
from runtime.identification.comparison.two_results import TwoResults
from runtime.outputs.report.figures import method_bars
from runtime.outputs.report.page import Page, Section, Tile

NAME = "compare.json"
FORMAT = 1
NOTHING, NOT_RUN = "–", "not run"
LARGEST_RMS = 1e9
"""Largest RMS torque error that is drawn [N·m, N]."""
_AGAIN = "run the comparison again, or give its output folder"

GLOSSARY = (
    ("test error", "100 ‖measured − predicted‖ / ‖measured‖ over the test split, all joints"),
    ("base error", "100 ‖β − β_true‖ / ‖β_true‖, where the log was simulated"),
    (
        "λ_min(P)/tr P",
        "smallest value over the links; negative where a link is not physically consistent",
    ),
    ("gap", "(loss − optimum) / optimum, in the weighted training loss common to all methods"),
    ("boundary", "a link is close to the limit of physical consistency, as a thin plate or rod is"),
)


@dataclass(frozen=True, slots=True)
class MethodEntry:
    """Results of one method."""

    method: str  # name
    outcome: str  # whether it ran, and why not
    status: str  # its final message
    # (n,) RMS torque errors [N·m, N]; None where it did not run
    rms: NDArray[np.float64] | None = None
    test: float = math.nan  # test, train: torque errors [%]; NaN where unknown
    train: float = math.nan
    base: float = math.nan  # error of the base parameters [%]; NaN where unknown
    seconds: float = math.nan  # computing time [s]
    iterations: int | None = None  # number of iterations, where it counts them
    eigenvalue: float = math.nan  # smallest λ_min(P)/tr P over the links
    gap: float = math.nan  # relative distance of its loss to the convex optimum
    consistent: bool = False  # whether all links are physically consistent
    boundary: bool = False  # whether a link is close to the limit of consistency


@dataclass(frozen=True, slots=True)
class MethodComparison:
    """Content of a comparison file."""

    robot: str
    recording: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    before: float
    entries: tuple[MethodEntry, ...]
    take: str | None
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: tuple[tuple[str, str], ...]


def read_methods(folder: Path) -> MethodComparison | None:
    """Read the comparison of a folder; None where the folder has none."""
    path = folder / NAME
    if not path.exists():
        return None
    try:
        raw = json_of(path)
        if raw["format"] != FORMAT:
            raise ValueError(f"format {FORMAT}")
        return _methods(raw)
    except OSError as error:
        raise RuntimeFault(f"cannot read '{path}' ({error.strerror or error}); {_AGAIN}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RuntimeFault(f"'{path}' is damaged (no valid {error}); {_AGAIN}") from None


def _methods(raw: Mapping[str, Any]) -> MethodComparison:
    joints = tuple(map(str, raw["joints"]))
    units = tuple(str(unit).replace("*", "·") for unit in raw["units"])
    entries = tuple(_entry(row, len(joints)) for row in raw["rows"])
    if len(units) != len(joints) or not entries:
        raise ValueError("'units' or 'rows'")
    source = raw["provenance"]
    facts = [("command", source["command"]), ("seed", source["seed"])]
    facts += [("model hash", source["model_hash"])]
    facts += [(f"version of {tool}", text) for tool, text in sorted(source["versions"].items())]
    facts += [(f"SHA-256 of {name}", text) for name, text in sorted(source["files"].items())]
    return MethodComparison(
        robot=str(raw["robot"]),
        recording=str(raw["recording"]["name"]),
        joints=joints,
        units=units,
        before=_number(raw["before_percent"]),
        entries=entries,
        take=raw["advice"]["take"],
        sentences=tuple(map(str, raw["advice"]["sentences"])),
        notes=tuple(map(str, raw["notes"])),
        provenance=tuple((key, str(value)) for key, value in facts),
    )


def _entry(row: Mapping[str, Any], n: int) -> MethodEntry:
    head = (str(row["method"]), str(row["outcome"]), str(row["status"]))
    if "rms" not in row:
        return MethodEntry(*head)
    rms = np.array(row["rms"], dtype=float)
    if rms.shape != (n,) or not (np.abs(rms) < LARGEST_RMS).all():
        raise ValueError(f"'rms': expected {n} numbers, got {rms.tolist()!r:.60}")
    return MethodEntry(
        *head,
        rms=rms,
        test=_number(row["test_percent"]),
        train=_number(row["train_percent"]),
        base=_number(row["base_error_percent"]),
        seconds=_number(row["seconds"]),
        iterations=row["iterations"],
        eigenvalue=_number(row["smallest_relative_eigenvalue"]),
        gap=_number(row["gap_to_convex_optimum"]),
        consistent=bool(row["consistent"]),
        boundary=bool(row["boundary"]),
    )


def comparison_page(methods: MethodComparison) -> Page:
    """Page of a folder that holds a comparison only."""
    facts = Table(("quantity", "value"), methods.provenance, kind="facts")
    return Page(
        title=f"{methods.robot}: comparison of methods",
        subtitle=f"{methods.robot} · all methods on the same data · {methods.recording}",
        headline=_sentence(methods.sentences[0]) if methods.sentences else "No recommendation.",
        status="",
        notes=methods.notes,
        tiles=_tiles(methods),
        sections=(*method_sections(methods), Section("Provenance", table=facts)),
        glossary=GLOSSARY,
    )


def _tiles(methods: MethodComparison) -> tuple[Tile, ...]:
    ran = [entry for entry in methods.entries if entry.rms is not None]
    good = [entry for entry in ran if entry.consistent]
    taken = next((entry for entry in ran if entry.method == methods.take), None)
    error = NOTHING if taken is None else f"{_percent(methods.before)} → {_percent(taken.test)}"
    return (
        Tile(
            "Recommended", methods.take or "none", "by the rules below", "good" if taken else "bad"
        ),
        Tile("Torque error of it", error, "test split, URDF → identified"),
        Tile("Consistent answers", f"{len(good)} of {len(ran)}", "all links physically consistent"),
        Tile(
            "Methods that ran",
            f"{len(ran)} of {len(methods.entries)}",
            "reasons of the others below",
        ),
    )


def method_sections(methods: MethodComparison) -> tuple[Section, ...]:
    """Recommendation, table, bar chart and the final message of every method."""
    ran = [entry for entry in methods.entries if entry.rms is not None]
    rows = tuple(_cells(entry) for entry in methods.entries)
    names = tuple(entry.method for entry in methods.entries)
    bad = (k for k, e in enumerate(methods.entries) if e.outcome != NOT_RUN and not e.consistent)
    header = (
        *("method", "train", "test", "base error", "time [s]", "iterations", "λ_min(P)/tr P"),
        *("gap", "verdict"),
    )
    table = Section(
        "Methods side by side",
        f"All methods use the same samples, weights and bandwidth. The torque error of the URDF "
        f"without friction is {_percent(methods.before)} on the test split.",
        Table(header, rows, flagged=frozenset(bad), row_methods=names),
    )
    messages = Section(
        "Final message of every method",
        items=tuple(f"{e.method}: {_sentence(e.status)}" for e in methods.entries),
    )
    why = Section("Recommendation and reasons", items=tuple(map(_sentence, methods.sentences)))
    if not ran:
        return (why, table, messages)
    drawn = method_bars(
        methods.joints,
        methods.units,
        [entry.method for entry in ran],
        np.array([entry.rms for entry in ran]),
        [entry.consistent for entry in ran],
    )
    bars = Section(
        "RMS of the torque error per joint and method",
        "On the test split. Blue: physically consistent; orange: inconsistent. Bars longer than "
        "three medians are cut (→).",
        figure=drawn,
    )
    return (why, table, bars, messages)


def _cells(entry: MethodEntry) -> tuple[str, ...]:
    if entry.rms is None:
        return (entry.method, *(NOTHING,) * 7, entry.outcome)
    verdict = "consistent" if entry.consistent else "inconsistent"
    return (
        entry.method,
        _percent(entry.train),
        _percent(entry.test),
        _percent(entry.base),
        f"{entry.seconds:.3f}",
        NOTHING if entry.iterations is None else str(entry.iterations),
        f"{entry.eigenvalue:.1e}",
        _percent(100 * entry.gap),
        "boundary" if entry.boundary else verdict,
    )


def results_page(both: TwoResults, robot: str, names: tuple[str, str]) -> Page:
    """Page that compares two results."""
    tables = (both.setup, both.errors, *both.values)
    return Page(
        title=f"{robot}: {names[0]} and {names[1]}",
        subtitle=f"{robot} · two results side by side",
        headline="; ".join(": ".join(each.split(": ")[:2]) for each in both.sentences) + ".",
        status="",
        notes=both.notes,
        tiles=(),
        sections=(
            Section("Differences", items=both.sentences),
            *(Section(t.title, table=replace(t, title="")) for t in tables),
        ),
        glossary=(
            ("in σ", "(second − first) / √(σ₁² + σ₂²)"),
            ("differs", "beyond the normal quantile of 1 − 0.05/(2 m), m rows of the table"),
        ),
    )


def _number(value: object) -> float:
    """Float of a JSON number; null is NaN, which JSON lacks."""
    return math.nan if value is None else float(value)  # type: ignore[arg-type]


def _percent(value: float) -> str:
    if not math.isfinite(value):
        return NOTHING
    return f"{significant(value, 3)}\N{NO-BREAK SPACE}%"


def _sentence(text: str) -> str:
    """Text that ends with a full stop."""
    return text if text.endswith(".") else f"{text}."
