"""What a motion will tell, as tables and sentences; and the options that decide about it."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import typer
from rich.table import Column, Table

from runtime.cli.common import console, numbers_option, say
from runtime.estimators.convex.posterior_spread import DETERMINED
from runtime.excitation import COST_SAMPLES, Design, Information, Prediction, information
from runtime.identification.expected_accuracy import Expected, GainOfRecording, base_names
from runtime.identification.expected_accuracy.earlier_logs import information_of_logs
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, inertia, links, mass
from runtime.recording import read_recording

EarlierLogs = Annotated[
    list[str] | None,
    typer.Option(
        "--earlier-log",
        metavar="LOG",
        help="A log that is recorded already: its information is added; repeatable.",
    ),
]
PayloadOnly = Annotated[
    bool,
    typer.Option(
        "--payload-only",
        help="Only the ten parameters of the last link are unknown, the arm is known.",
    ),
]


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
    known = information_of_logs(
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
    if found.variations:
        best = min(found.variations)
        say(f"{len(found.variations)} variations of the best starts, cond: best {best:.4g}")
    console.print(criteria_table(expected))
    for sentence in prediction_sentences(expected):
        say(sentence)
    for assumption in found.assumptions:
        say(f"note: {assumption}")


def criteria_table(prediction: Prediction) -> Table:
    """All criteria, for every set of columns and number of samples."""
    unknowns = "payload" if prediction.payload_only else "base"
    prior = ", with earlier logs" if prediction.has_earlier_logs else ""
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
    lines = [torque_sentence(prediction.torque)]
    if prediction.payload_mass is not None and prediction.payload_com is not None:
        lines.append(_payload(prediction.payload_mass, prediction.payload_com))
    return (*lines, *(f"note: {note}" for note in prediction.notes))


def torque_sentence(bands: Array) -> str:
    """σ of torques of motions never seen."""
    told = ", ".join(f"{1000 * value:.2f}" for value in bands)
    return f"expected σ of the predicted torque, joint by joint: {told} mN·m"


def _payload(mass: float, com: Array) -> str:
    told = " ".join(f"{1000 * value:.2f}" for value in com)
    return (
        f"a payload of 1 kg on a known arm: mass to ±{1000 * mass:.2f} g, "
        f"centre of mass to ±({told}) mm"
    )


def payload_sentence(found: Expected, alone: bool) -> str:
    """What is told of a payload; its inertia, too, where nothing else is asked for."""
    if found.payload is None or found.payload_com is None:
        return "note: a payload on the last link stays untold; too few joints turn it"
    told = _payload(float(mass(found.payload)), found.payload_com)
    if not alone:
        return told
    sigmas = " ".join(f"{value:.2g}" for value in inertia(found.payload))
    return f"{told}, inertia xx yy zz xy xz yz about the link's origin to ±({sigmas}) kg·m²"


def base_table(found: Expected, lib: Library) -> Table:
    """σ of every base parameter, the worst relative to its size first."""
    table = Table(title="base parameters: expected σ, the worst first")
    table.add_column("around", overflow="fold")
    for head in ("least squares", "with prior", "% of size"):
        table.add_column(head, justify="right")
    names = base_names(lib)
    for k in np.argsort(-found.relative):
        table.add_row(
            names[k].removeprefix("base "),
            "untold" if found.base is None else f"{found.base[k]:.3g}",
            f"{found.base_map[k]:.3g}",
            f"{100 * found.relative[k]:.2f}",
        )
    return table


def link_table(found: Expected, lib: Library) -> Table:
    """σ of every link's mass, centre of mass and inertia, and what of it is the prior's."""
    table = Table(Column("link", overflow="fold"), title="links: expected σ with the URDF as prior")
    for head in ("mass g", "CoM mm", "inertia kg·m²", "the data tell"):
        table.add_column(head, justify="right")
    rows = zip(
        lib.link_names,
        links(found.pi),
        found.com,
        links(found.share),
        strict=True,
    )
    for name, own, com, share in rows:
        table.add_row(
            name,
            f"{1000 * mass(own):.2f}",
            " ".join(f"{1000 * value:.2f}" for value in com),
            f"{inertia(own).max():.2g}",
            f"{np.sum(share < DETERMINED)} of {N_PARAMETERS}",
        )
    return table


def worth_table(worths: Sequence[GainOfRecording]) -> Table:
    """What some more seconds improve: the payload, how many numbers, and which most of all."""
    table = Table("more", title=f"expected gain of σ by more of {worths[0].motion}, %")
    names = [name for name in worths[0].gains if name.startswith("payload")]
    for head in (*sorted(names), "most", "above 10 %"):
        table.add_column(head, justify="right")
    table.add_column("most of all")
    for worth in worths:
        top, gain = next(iter(worth.gains.items()))
        table.add_row(
            f"{worth.seconds:g} s",
            *(f"{100 * worth.gains[name]:.1f}" for name in sorted(names)),
            f"{100 * gain:.1f}",
            f"{len(worth.gaining)} of {len(worth.gains)}",
            top,
        )
    return table
