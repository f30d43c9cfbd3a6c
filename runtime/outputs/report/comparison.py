"""`compare.json` → a page, or sections of a page, that compare the methods; and two results."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of
from runtime.common.tables import NOTHING, significant
from runtime.errors import RuntimeFault
from runtime.identification.comparison.two_results import TwoResults
from runtime.identification.result_tables import method_table
from runtime.library import Array
from runtime.outputs.report.figures import method_bars
from runtime.outputs.report.page import Page, Section, Tile, provenance

NAME = "compare.json"
FORMAT = 1
LARGEST_RMS = 1e9  # largest RMS torque error that is drawn [N·m, N]
_AGAIN = "run the comparison again, or give its output folder"

GLOSSARY = (
    (
        "train %, error %",
        "100 ‖measured − predicted‖ / ‖measured‖ over the training and the test split",
    ),
    ("base %", "100 ‖β − β_true‖ / ‖β_true‖, where the log was simulated"),
    (
        "λ_min/tr",
        "smallest λ_min(P)/tr P over the links; negative where a link is not physically consistent",
    ),
    ("gap %", "(loss − optimum) / optimum, in the weighted training loss common to all methods"),
    ("boundary", "a link is close to the limit of physical consistency, as a thin plate or rod is"),
)


def comparison_page(folder: Path) -> Page | None:
    """Page of the comparison of a folder, provenance last; None where the folder has none."""
    path = folder / NAME
    if not path.exists():
        return None
    try:
        facts = json_of(path)
        if facts["format"] != FORMAT:
            raise ValueError(f"format {FORMAT}")
        return _page(facts)
    except OSError as error:
        raise RuntimeFault(f"cannot read '{path}' ({error.strerror or error}); {_AGAIN}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RuntimeFault(f"'{path}' is damaged (no valid {error}); {_AGAIN}") from None


def _page(facts: Mapping[str, Any]) -> Page:
    rows, advice, source = facts["rows"], facts["advice"], facts["provenance"]
    robot, recording = facts["robot"], facts["recording"]["name"]
    if len(facts["units"]) != len(facts["joints"]) or not rows:
        raise ValueError("'units' or 'rows'")
    sentences = tuple(_sentence(str(each)) for each in advice["sentences"])
    keys = ("command", "seed", "model_hash", "versions", "files")
    return Page(
        title=f"{robot}: comparison of methods",
        subtitle=f"{robot} · all methods on the same data · {recording}",
        headline=sentences[0] if sentences else "No recommendation.",
        notes=tuple(map(str, facts["notes"])),
        tiles=_tiles(rows, advice["take"], facts["before_percent"]),
        sections=(
            Section("Recommendation and reasons", items=sentences),
            *_sections(facts, rows),
            provenance(*(source[key] for key in keys)),
        ),
        glossary=GLOSSARY,
    )


def _tiles(
    rows: Sequence[Mapping[str, Any]], take: str | None, before: float | None
) -> tuple[Tile, ...]:
    ran = [row for row in rows if "rms" in row]
    good = [row for row in ran if row["consistent"]]
    taken = next((row for row in ran if row["method"] == take), None)
    error = NOTHING if taken is None else f"{_percent(before)} → {_percent(taken['test_percent'])}"
    return (
        Tile("Recommended", take or "none", "by the rules below", "good" if taken else "bad"),
        Tile("Torque error of it", error, "test split, URDF → identified"),
        Tile("Consistent answers", f"{len(good)} of {len(ran)}", "all links physically consistent"),
        Tile("Methods that ran", f"{len(ran)} of {len(rows)}", "reasons of the others below"),
    )


def _sections(facts: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Iterator[Section]:
    """Table, bar chart and the final message of every method."""
    joints = tuple(map(str, facts["joints"]))
    units = tuple(str(unit).replace("*", "·") for unit in facts["units"])
    yield Section(
        "Methods side by side",
        f"All methods use the same samples, weights and bandwidth. The torque error of the URDF "
        f"without friction is {_percent(facts['before_percent'])} on the test split.",
        method_table(rows),
    )
    ran = [row for row in rows if "rms" in row]
    if ran:
        yield Section(
            "RMS of the torque error per joint and method",
            "On the test split. Blue: physically consistent; orange: inconsistent. Bars longer "
            "than three medians are cut (→).",
            figure=method_bars(
                joints,
                units,
                [str(row["method"]) for row in ran],
                np.array([_rms(row["rms"], len(joints)) for row in ran]),
                [bool(row["consistent"]) for row in ran],
            ),
        )
    messages = tuple(f"{row['method']}: {_sentence(str(row['status']))}" for row in rows)
    yield Section("Final message of every method", items=messages)


def _rms(values: Sequence[float], n: int) -> Array:
    """RMS torque errors of one method, (n,) [N·m, N]."""
    rms = np.array(values, dtype=float)
    if rms.shape != (n,) or not (np.abs(rms) < LARGEST_RMS).all():
        raise ValueError(f"'rms': expected {n} numbers, got {rms.tolist()!r:.60}")
    return rms


def results_page(both: TwoResults, robot: str, names: tuple[str, str]) -> Page:
    """Page that compares two results."""
    tables = (both.setup, both.errors, *both.values)
    return Page(
        title=f"{robot}: {names[0]} and {names[1]}",
        subtitle=f"{robot} · two results side by side",
        headline="; ".join(": ".join(each.split(": ")[:2]) for each in both.sentences) + ".",
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


def _percent(value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return NOTHING
    return f"{significant(value, 3)}\N{NO-BREAK SPACE}%"


def _sentence(text: str) -> str:
    """Text that ends with a full stop."""
    return text if text.endswith(".") else f"{text}."
