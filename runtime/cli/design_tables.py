"""Criteria and expected accuracy of a designed motion as a table and sentences."""

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from runtime.cli.common import console, say
from runtime.cli.predict_tables import torque_sentence, unit_payload_sentence
from runtime.excitation import COST_SAMPLES, Design, Prediction
from runtime.library import Library
from runtime.library.torque_units import common_unit, torque_units


def print_design(optimum: Design, expected: Prediction, lib: Library, note: str) -> None:
    """Print the criteria of a design, their spread over the starts, and the expected accuracy."""
    say(
        f"condition number {optimum.condition:.4f} of the column-normalised base regressor "
        f"({len(lib.base_columns)} columns, {COST_SAMPLES} samples)"
    )
    spreads = {"cond": optimum.conditions}
    if optimum.criterion != "cond":
        spreads = {f"{optimum.criterion} ({optimum.unit})": optimum.values, **spreads}
    for label, values in spreads.items():
        say(
            f"starts, {label}: best {min(values):.4g}, median {np.median(values):.4g}, "
            f"worst {max(values):.4g}"
        )
    if optimum.variations:
        best = min(optimum.variations)
        say(f"{len(optimum.variations)} variations of the best starts, cond: best {best:.4g}")
    units = torque_units(lib.manifest)
    console.print(criteria_table(expected, units))
    for sentence in (*prediction_sentences(expected, units), *([note] if note else [])):
        say(sentence)
    for assumption in optimum.assumptions:
        say(f"note: {assumption}")


def criteria_table(prediction: Prediction, units: Sequence[str]) -> Table:
    """All criteria, for each set of unknowns and each number of samples."""
    unknowns = "payload" if prediction.payload_only else "base"
    prior = ", with earlier logs" if prediction.has_earlier_logs else ""
    sigma = prediction.noise
    noise = f"{sigma.min():g}" + ("" if np.ptp(sigma) == 0 else f"–{sigma.max():g}")
    table = Table(
        title=f"expected at {noise} {common_unit(units)} of torque noise, "
        f"{prediction.rate:g} Hz{prior}; cond: unit columns"
    )
    table.add_column("columns")
    for head in ("samples", "cond", "A %", f"V {common_unit(units, 'm')}", "D"):
        table.add_column(head, justify="right")
    for score in prediction.scores:
        names = f"{score.columns} = {unknowns}" + (" + friction" if score.friction else "")
        table.add_row(
            names,
            str(score.samples),
            f"{score.condition:.3f}",
            f"{100 * score.relative_error:.2f}",
            f"{1000 * score.torque_error:.2f}",
            f"{score.half_axis:.3g}",
        )
    return table


def prediction_sentences(prediction: Prediction, units: Sequence[str]) -> tuple[str, ...]:
    """Expected accuracy of torque and payload, and notes."""
    lines = [torque_sentence(prediction.torque, units)]
    if prediction.payload_mass is not None and prediction.payload_com is not None:
        lines.append(unit_payload_sentence(prediction.payload_mass, prediction.payload_com))
    return (*lines, *(f"note: {note}" for note in prediction.notes))
