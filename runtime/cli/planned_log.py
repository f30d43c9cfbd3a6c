"""A log that is not yet recorded: noise, friction columns, earlier knowledge, expected accuracy.

The noise of --noise is given as numbers, or as a log whose residuals are its noise:

    σ_j = RMS of the residuals of joint j,    T = (N / N_eff) / f

They contain the model error, friction beyond the columns, gains and delays, and are autocorrelated,
so that only one row per T counts as independent. Numbers are independent noise alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import typer

from runtime.cli.common import numbers_option
from runtime.common.settings import data_option, model_option
from runtime.common.tables import Table
from runtime.common.texts import numbers_of
from runtime.errors import IdentificationError, RuntimeFault
from runtime.estimators.regression.posterior import DETERMINED
from runtime.excitation.search.information import FRICTION, NoiseSpectrum, information, spectrum_of
from runtime.identification.expected_accuracy import expected as accuracy
from runtime.identification.expected_accuracy.planned_samples import motion_samples_of, noise_of
from runtime.identification.prepared_log import prepared_log
from runtime.identification.settings import NO_FRICTION, Settings
from runtime.library import Array, Library
from runtime.library.manifest import listed_torques
from runtime.library.parameters import N_PARAMETERS, inertia, links, mass
from runtime.recording import Friction, read_recording

NOISE_HELP = (
    "Torque noise: its standard deviation in N·m or N, one number or one per joint with commas, "
    "without model error; or a log of this robot, whose residuals contain friction beyond the "
    "columns, gains and delays, with their autocorrelation"
)
WHITE, COLOURED = "white", "coloured"
NoiseModel = Annotated[
    str,
    model_option(
        metavar="white|coloured",
        help="Spectrum of the noise of --noise LOG in the criteria: white counts autocorrelated "
        "rows as fewer; coloured weights every frequency of a motion by the noise of the log, "
        "which contains what friction columns, gains and delays leave.",
    ),
]
Cutoff = Annotated[
    float | None,
    typer.Option(
        metavar="HZ",
        help="Cut-off of the low-pass that the log of the motion will pass: what the motion has "
        "beyond it does not count in the criteria.",
    ),
]
EarlierLogs = Annotated[
    list[str] | None,
    data_option(
        metavar="LOG", help="A log that is recorded already; its information is added. Repeatable."
    ),
]
PayloadOnly = Annotated[
    bool,
    typer.Option(help="Only the ten parameters of the last link are unknown; the arm is known."),
]


@dataclass(frozen=True, slots=True)
class TorqueNoise:
    """Noise of the torque of a planned motion."""

    sigma: Array  # (n,) N·m or N
    spacing: float = 0.0  # time between independent rows, s; 0 where all rows are independent
    log: str | None = None  # name of the log that it is from; None for numbers
    spectrum: NoiseSpectrum | None = None  # of a log's noise, for noise_model=coloured

    def rows_per_independent(self, rate: float) -> float:
        """Rows that count as one independent row."""
        return max(1.0, rate * self.spacing)

    def sentence(self) -> str:
        """Sentence on what σ does not contain; empty for the noise of a log."""
        if self.log is not None:
            return ""
        return (
            "note: σ counts independent torque noise alone; friction beyond the columns, gains and "
            "delays make real errors larger. --noise LOG, a log of this robot, counts its residuals"
        )


def planned_noise(
    lib: Library, text: str, friction: tuple[str, ...] | None = None, model: str = WHITE
) -> TorqueNoise:
    """Noise from the value of --noise."""
    if model not in (WHITE, COLOURED):
        raise IdentificationError(
            f"expected --settings noise_model={WHITE} or {COLOURED}, got '{model:.40}'; correct it"
        )
    if numbers := numbers_of(text):
        if model == COLOURED:
            raise IdentificationError(
                f"--settings noise_model={COLOURED} takes the spectrum from a log; give --noise LOG"
            )
        count = lib.n_joints if len(numbers) > 1 else 1
        sigma = np.array(numbers_option(text, count, "--noise"))
        return TorqueNoise(information(lib, np.broadcast_to(sigma, lib.n_joints)).noise)
    names = FRICTION if friction is None else friction
    log = read_recording(text, joints=lib.joint_names)
    data = prepared_log(log, lib, Settings(friction=names or NO_FRICTION))
    moved = motion_samples_of(data.recording, lib, data.preparation, Friction(names))
    noise = noise_of(lib, moved)
    if noise is None:
        raise IdentificationError(
            f"--noise needs a log with measured torque and more rows than unknowns, got '{text}'; "
            "give another log, or the standard deviation in N·m or N"
        )
    if model == WHITE:
        return TorqueNoise(noise.sigma, noise.inflation / moved.rate, moved.name)
    steps = data.preparation or data.recording.preparation
    spectrum = spectrum_of(noise.rest, moved.rate, steps.cutoff_hz)
    return TorqueNoise(noise.sigma, noise.repeated / moved.rate, moved.name, spectrum)


def friction_columns(text: str) -> tuple[str, ...]:
    """Friction columns from --friction."""
    words = tuple(text.split(","))
    if any(word.replace(".", "", 1).strip("+- ").isdecimal() for word in words):
        raise IdentificationError(
            f"--friction needs names of columns with commas, or none, got '{text}'; the setting "
            "viscous and the setting coulomb of excite take numbers"
        )
    return () if text == "none" else words


def require_gain_error(gain_error: float) -> None:
    """Check a value of the setting gain_error."""
    if not 0 <= gain_error < 1:
        raise RuntimeFault(
            f"the setting gain_error is a share of one, such as 0.005, got {gain_error:g}"
        )


def torque_sentence(bands: Array, units: Sequence[str], gain_error: float = 0.0) -> str:
    """Sentence on the σ of predicted torque for motions that are not in the log."""
    sigmas = listed_torques(1000 * bands, units, ".2f", "m")
    if gain_error:
        off = f"{100 * gain_error:g} % off (the setting gain_error), which residuals hardly show"
        return f"with torque gains that may be {off}: {sigmas}"
    return f"expected σ of the predicted torque, joint by joint: {sigmas}"


def unit_payload_sentence(mass: float, com: Array) -> str:
    """Sentence on the accuracy of a payload of 1 kg."""
    position = " ".join(f"{1000 * value:.2f}" for value in com)
    return (
        f"a payload of 1 kg on a known arm: mass to ±{1000 * mass:.2f} g, "
        f"centre of mass to ±({position}) mm"
    )


def payload_sentence(expected: accuracy.Expected, alone: bool) -> str:
    """Sentence on the expected accuracy of a payload."""
    if expected.payload is None:
        return "note: a payload on the last link is not identifiable: too few joints turn it"
    sentence = (
        f"{unit_payload_sentence(float(mass(expected.payload.pi)), expected.payload.com)}, against "
        "an empty run of the same motion; without one, an arm whose links are "
        f"{100 * accuracy.ARM_ERROR:g} % off its model adds "
        f"±{1000 * mass(expected.payload.of_arm):.3g} g to the mass"
    )
    if not alone:
        return sentence
    sigmas = " ".join(f"{value:.2g}" for value in inertia(expected.payload.pi))
    return f"{sentence}, inertia xx yy zz xy xz yz about the link's origin to ±({sigmas}) kg·m²"


def base_table(expected: accuracy.Expected, lib: Library) -> Table:
    """Expected σ of every base parameter, the largest relative to its value first."""
    names, base = accuracy.base_names(lib), expected.base
    rows = tuple(
        (
            names[k].removeprefix("base "),
            "not identifiable" if base is None else f"{base[k]:.3g}",
            f"{expected.base_map[k]:.3g}",
            f"{100 * expected.relative[k]:.2f}",
        )
        for k in np.argsort(-expected.relative)
    )
    title = "base parameters: expected σ, the largest relative σ first"
    return Table(("around", "least squares", "MAP", "MAP % of value"), rows, title=title)


def link_table(expected: accuracy.Expected, lib: Library) -> Table:
    """Expected σ of mass, centre of mass and inertia of every link by MAP."""
    bodies = zip(
        lib.link_names, links(expected.pi), expected.com, links(expected.share), strict=True
    )
    rows = tuple(
        (
            name,
            f"{1000 * mass(pi):.2f}",
            " ".join(f"{1000 * value:.2f}" for value in com),
            f"{inertia(pi).max():.2g}",
            f"{np.sum(share < DETERMINED)} of {N_PARAMETERS}",
        )
        for name, pi, com, share in bodies
    )
    head = ("link", "mass g", "CoM mm", "inertia kg·m²", "from the data")
    return Table(head, rows, title="links: expected σ with the URDF as prior")


def gain_table(steps: Sequence[accuracy.GainOfRecording]) -> Table:
    """Improvement of σ by more recording: payload, largest, and count of those above 10 %."""
    names = sorted(name for name in steps[0].gains if name.startswith("payload"))
    rows = []
    for step in steps:
        top, gain = next(iter(step.gains.items()))
        cells = (f"{100 * x:.1f}" for x in (*(step.gains[name] for name in names), gain))
        rows.append(
            (f"{step.seconds:g} s", *cells, f"{len(step.gaining)} of {len(step.gains)}", top)
        )
    head = ("more", *names, "largest", "above 10 %", "largest gain of")
    return Table(head, tuple(rows), title=f"expected gain of σ by more of {steps[0].motion}, %")
