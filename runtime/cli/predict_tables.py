"""Expected accuracy of a motion as tables and sentences, and the options that it depends on."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
import typer
from rich.table import Column, Table

from runtime.cli.planned_noise import WHITE, planned_noise, with_spectrum
from runtime.errors import IdentificationError
from runtime.estimators.convex.posterior_spread import DETERMINED
from runtime.excitation import Information, information
from runtime.excitation.search.information import FRICTION
from runtime.identification.expected_accuracy.expected import ARM_ERROR, Expected, base_names
from runtime.identification.expected_accuracy.growth import GainOfRecording
from runtime.identification.expected_accuracy.planned_samples import information_of_logs
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, inertia, links, mass
from runtime.library.torque_units import listed_torques
from runtime.recording import read_recording

EarlierLogs = Annotated[
    list[str] | None,
    typer.Option(
        "--earlier-log",
        metavar="LOG",
        help="A log that is recorded already; its information is added. Repeatable.",
    ),
]
PayloadOnly = Annotated[
    bool,
    typer.Option(
        "--payload-only",
        help="Only the ten parameters of the last link are unknown; the arm is known.",
    ),
]


def friction_columns(text: str) -> tuple[str, ...]:
    """Friction columns from --friction."""
    words = tuple(text.split(","))
    if any(word.replace(".", "", 1).strip("+- ").isdecimal() for word in words):
        raise IdentificationError(
            f"--friction needs names of columns with commas, or none, got '{text}'; --viscous and "
            "--coulomb of excite take numbers"
        )
    return () if text == "none" else words


def information_of(
    lib: Library,
    noise: str,
    rate: float,
    logs: Sequence[str] | None,
    payload_only: bool,
    friction: str | None = None,
    model: str = WHITE,
    cutoff: float | None = None,
) -> tuple[Information, str]:
    """Noise, rate, earlier logs and unknowns of a planned log."""
    information(lib, rate=rate)  # raises where the rate is out of range
    columns = None if friction is None else friction_columns(friction)
    torque = planned_noise(lib, noise, columns, model)
    sigma, independent = torque.sigma, rate / torque.rows_per_independent(rate)
    planned = information(lib, sigma, independent, payload=payload_only, friction=columns)
    planned = with_spectrum(planned, torque, cutoff)
    if not logs:
        return planned, torque.sentence()
    recordings = [read_recording(log, joints=lib.joint_names) for log in logs]
    known = information_of_logs(lib, recordings, sigma, FRICTION if columns is None else columns)
    return replace(planned, earlier=known), torque.sentence()


def torque_sentence(bands: Array, units: Sequence[str], gain_error: float = 0.0) -> str:
    """Sentence on the σ of predicted torque for motions that are not in the log."""
    sigmas = listed_torques(1000 * bands, units, ".2f", "m")
    if gain_error:
        off = f"{100 * gain_error:g} % off (--gain-error), which residuals hardly show"
        return f"with torque gains that may be {off}: {sigmas}"
    return f"expected σ of the predicted torque, joint by joint: {sigmas}"


def unit_payload_sentence(mass: float, com: Array) -> str:
    """Sentence on the accuracy of a payload of 1 kg."""
    position = " ".join(f"{1000 * value:.2f}" for value in com)
    return (
        f"a payload of 1 kg on a known arm: mass to ±{1000 * mass:.2f} g, "
        f"centre of mass to ±({position}) mm"
    )


def payload_sentence(expected: Expected, alone: bool) -> str:
    """Sentence on the expected accuracy of a payload."""
    if expected.payload is None or expected.payload_com is None:
        return "note: a payload on the last link is not identifiable: too few joints turn it"
    sentence = unit_payload_sentence(float(mass(expected.payload)), expected.payload_com)
    if expected.payload_of_arm is not None:
        sentence += (
            ", against an empty run of the same motion; without one, an arm whose links are "
            f"{100 * ARM_ERROR:g} % off its model adds ±{1000 * mass(expected.payload_of_arm):.3g} "
            "g to the mass"
        )
    if not alone:
        return sentence
    sigmas = " ".join(f"{value:.2g}" for value in inertia(expected.payload))
    return f"{sentence}, inertia xx yy zz xy xz yz about the link's origin to ±({sigmas}) kg·m²"


def base_table(expected: Expected, lib: Library) -> Table:
    """Expected σ of every base parameter, the largest relative to its value first."""
    table = Table(title="base parameters: expected σ, the largest relative σ first")
    table.add_column("around", overflow="fold")
    for head in ("least squares", "MAP", "MAP % of value"):
        table.add_column(head, justify="right")
    names = base_names(lib)
    for k in np.argsort(-expected.relative):
        table.add_row(
            names[k].removeprefix("base "),
            "not identifiable" if expected.base is None else f"{expected.base[k]:.3g}",
            f"{expected.base_map[k]:.3g}",
            f"{100 * expected.relative[k]:.2f}",
        )
    return table


def link_table(expected: Expected, lib: Library) -> Table:
    """Expected σ of mass, centre of mass and inertia of every link by MAP."""
    table = Table(Column("link", overflow="fold"), title="links: expected σ with the URDF as prior")
    for head in ("mass g", "CoM mm", "inertia kg·m²", "from the data"):
        table.add_column(head, justify="right")
    rows = zip(
        lib.link_names,
        links(expected.pi),
        expected.com,
        links(expected.share),
        strict=True,
    )
    for name, pi, com, share in rows:
        table.add_row(
            name,
            f"{1000 * mass(pi):.2f}",
            " ".join(f"{1000 * value:.2f}" for value in com),
            f"{inertia(pi).max():.2g}",
            f"{np.sum(share < DETERMINED)} of {N_PARAMETERS}",
        )
    return table


def gain_table(steps: Sequence[GainOfRecording]) -> Table:
    """Improvement of σ by more recording: payload, largest, and count of those above 10 %."""
    table = Table("more", title=f"expected gain of σ by more of {steps[0].motion}, %")
    names = [name for name in steps[0].gains if name.startswith("payload")]
    for head in (*sorted(names), "largest", "above 10 %"):
        table.add_column(head, justify="right")
    table.add_column("largest gain of")
    for step in steps:
        top, gain = next(iter(step.gains.items()))
        table.add_row(
            f"{step.seconds:g} s",
            *(f"{100 * step.gains[name]:.1f}" for name in sorted(names)),
            f"{100 * gain:.1f}",
            f"{len(step.gaining)} of {len(step.gains)}",
            top,
        )
    return table
