"""What a designed motion will tell, as a table; and the options that decide about it."""

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from runtime.cli.common import console, numbers_option, say
from runtime.excitation import COST_SAMPLES, Design, Information, Prediction, information
from runtime.library import Array, Library
from runtime.prior import prior_information
from runtime.recording import read_recording


def torque_noise(text: str, joints: int) -> Array:
    """One number for all joints or one for each, separated by commas, N·m."""
    count = joints if "," in text else 1
    return np.broadcast_to(np.array(numbers_option(text, count, "--noise")), joints).copy()


def information_of(
    lib: Library, noise: str, rate: float, logs: Sequence[str] | None, payload: bool
) -> Information:
    """Noise, rate, earlier logs and unknowns as the options name them."""
    told = information(lib, torque_noise(noise, lib.n_joints), rate, payload=payload)
    if not logs:
        return told
    known = prior_information(
        lib, [read_recording(log, joints=lib.joint_names) for log in logs], told.noise
    )
    return information(lib, told.noise, rate, known, payload)


def tell(found: Design, expected: Prediction, columns: int) -> None:
    """The design's criteria, their spread over the starts, and what the motion will tell."""
    say(
        f"condition number {found.condition:.4f} of the column-normalised base regressor "
        f"({columns} columns, {COST_SAMPLES} samples)"
    )
    spreads = {"cond": found.conditions}
    if found.criterion != "cond":
        spreads = {f"{found.criterion} ({found.unit})": found.values, **spreads}
    for label, values in spreads.items():
        say(
            f"starts, {label}: best {min(values):.4g}, median {np.median(values):.4g}, "
            f"worst {max(values):.4g}"
        )
    if found.relatives:
        best = min(found.relatives)
        say(f"{len(found.relatives)} relatives of the best starts, cond: best {best:.4g}")
    console.print(criteria_table(expected))
    for sentence in prediction_sentences(expected):
        say(sentence)
    for assumption in found.assumptions:
        say(f"note: {assumption}")


def criteria_table(prediction: Prediction) -> Table:
    """All criteria, for every set of columns and number of samples."""
    unknowns = "payload" if prediction.payload_only else "base"
    prior = ", with earlier logs" if prediction.has_prior else ""
    sigma = prediction.noise
    noise = f"{sigma.min():g}" + ("" if np.ptp(sigma) == 0 else f"–{sigma.max():g}")
    table = Table(
        title=f"expected at {noise} N·m of torque noise, {prediction.rate:g} Hz{prior}; "
        "cond: unit columns"
    )
    table.add_column("columns")
    for head in ("samples", "cond", "A %", "V mN·m", "D"):
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


def prediction_sentences(prediction: Prediction) -> tuple[str, ...]:
    """What the table does not hold."""
    bands = ", ".join(f"{1000 * value:.2f}" for value in prediction.torque)
    lines = [f"expected σ of the predicted torque, joint by joint: {bands} mN·m"]
    if prediction.payload_mass is not None and prediction.payload_com is not None:
        com = " ".join(f"{1000 * value:.2f}" for value in prediction.payload_com)
        lines.append(
            f"a payload of 1 kg on a known arm: mass to ±{1000 * prediction.payload_mass:.2f} g, "
            f"centre of mass to ±({com}) mm"
        )
    return (*lines, *(f"note: {note}" for note in prediction.notes))
