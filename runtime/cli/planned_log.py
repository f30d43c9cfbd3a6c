"""Assumptions about a log that is not yet recorded: noise, friction columns, earlier knowledge.

The noise of --noise is given as numbers, or as a log whose residuals are its noise:

    σ_j = RMS of the residuals of joint j,    T = (N / N_eff) / f

A log of the robot contains its model error: friction beyond the columns, gains, delays. Its
residuals are autocorrelated, so that only one row per T counts as independent. Numbers are
independent noise alone.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import typer

from runtime.cli.common import numbers_option
from runtime.common.settings import data_option, model_option
from runtime.errors import IdentificationError, RuntimeFault
from runtime.excitation.search.information import (
    FRICTION,
    NOISE,
    NoiseSpectrum,
    information,
    spectrum_of,
)
from runtime.identification.expected_accuracy.expected import Expected, Knowledge, expected
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    Noise,
    information_of_logs,
    motion_samples_of,
    noise_of,
)
from runtime.identification.prepared_log import prepared_log
from runtime.identification.settings import NO_FRICTION, Settings
from runtime.library import Array, Library
from runtime.library.manifest import common_unit, torque_units
from runtime.recording import Friction, read_recording

NOISE_HELP = (
    "Torque noise: its standard deviation in N·m or N, one number or one per joint with commas, "
    "without model error; or a log of this robot, whose residuals contain friction beyond the "
    "columns, gains and delays, with their autocorrelation"
)
"""Help of the option."""
WHITE, COLOURED = "white", "coloured"
NoiseModel = Annotated[
    str,
    model_option(
        "--noise-model",
        metavar="white|coloured",
        help="Spectrum of the noise of --noise LOG in the criteria: white counts autocorrelated "
        "rows as fewer; coloured weights every frequency of a motion by the noise of the log, "
        "which contains what friction columns, gains and delays leave.",
    ),
]
Cutoff = Annotated[
    float | None,
    typer.Option(
        "--cutoff",
        metavar="HZ",
        help="Cut-off of the low-pass that the log of the motion will pass: what the motion has "
        "beyond it does not count in the criteria.",
    ),
]
EarlierLogs = Annotated[
    list[str] | None,
    data_option(
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


@dataclass(frozen=True, slots=True)
class TorqueNoise:
    """Noise of the torque of a planned motion."""

    sigma: Array  # (n,) N·m or N
    spacing: float = 0.0  # time between independent rows, s; 0 where all rows are independent
    log: str | None = None  # name of the log that it is from; None for numbers
    # of the noise of a log, for --settings noise_model=coloured
    spectrum: NoiseSpectrum | None = None

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
    words = text.split(",")
    if all(_is_number(word) for word in words):
        if model == COLOURED:
            raise IdentificationError(
                f"--settings noise_model={COLOURED} takes the spectrum from a log; give --noise LOG"
            )
        count = lib.n_joints if len(words) > 1 else 1
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


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


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


_MOMENTUM = "; rows of momentum, which show more than the rows of energy that the recipe states"


@dataclass(frozen=True, slots=True)
class Situation:
    """A motion or log, the noise of its torque, and the knowledge before it."""

    lib: Library  # library of the robot
    moved: MotionSamples  # samples of the motion
    noise: Array  # σ of the torque, (n,) N·m
    unit: float  # samples per independent sample, at least 1
    from_residuals: bool  # whether `noise` is from the residuals of the motion itself
    planned: TorqueNoise  # noise that was given, or that of a planned motion
    known: Knowledge  # prior and earlier logs

    def expected(self, more: MotionSamples | None = None, seconds: float = 0.0) -> Expected:
        """Expected accuracy of the motion, and of some seconds of another motion after it."""
        statistics = self.moved.statistics(self.lib, self.noise)
        if more is not None:
            statistics = statistics.merged(more.statistics(self.lib, self.noise, seconds))
        sigmas = expected(self.lib, statistics, self.known, self.unit, self.moved.columns)
        if self.known.payload_only and sigmas.payload is None:
            raise IdentificationError(
                f"'{self.moved.name}' does not determine all ten parameters of a payload; give a "
                "motion that turns the last link about all axes (excite --settings "
                "payload_only=true designs one)"
            )
        return sigmas

    def sentence(self) -> str:
        """Sentence on duration, samples, noise and unknowns."""
        low, high = self.noise.min(), self.noise.max()
        size = f"{low:.3g}" + ("" if low == high else f"–{high:.3g}")
        origin = " (RMS of the log's residuals)" if self.from_residuals else ""
        if self.planned.log is not None and not self.from_residuals:
            origin = f" (RMS of the residuals of {self.planned.log})"
        count = len(self.moved.samples)
        effective = (
            f", as good as {count / self.unit:.0f} independent ones" if self.unit > 1 else ""
        )
        earlier = ", earlier logs counted" if self.known.earlier is not None else ""
        beside = ", ".join(self.moved.columns) or "none"
        rows = _MOMENTUM if self.moved.replaces_power else ""
        unit = common_unit(torque_units(self.lib.manifest))
        return (
            f"{self.moved.name}: {self.moved.seconds:.3g} s, {count} samples{effective}; torque "
            f"noise {size} {unit}{origin}; friction columns: {beside}{earlier}{rows}"
        )

    def facts(self) -> dict[str, object]:
        """The same as JSON-ready values."""
        count = len(self.moved.samples)
        return {
            "robot": self.lib.name,
            "motion": self.moved.name,
            "seconds": self.moved.seconds,
            "rate_hz": self.moved.rate,
            "n_samples": count,
            "n_eff": count / self.unit,
            "torque_noise": self.noise.tolist(),
            "noise_from_residuals": self.from_residuals,
            "noise_log": None if self.from_residuals else self.planned.log,
            "friction": list(self.moved.columns),
            "earlier_logs_count": self.known.earlier is not None,
        }


def situation_of(
    lib: Library,
    moved: MotionSamples,
    noise: str | None,
    earlier: list[str] | None,
    payload_only: bool,
) -> Situation:
    """Situation of the options; the noise is by default that of the log's residuals."""
    given = None if noise is None else planned_noise(lib, noise, moved.columns)
    planned = given or TorqueNoise(np.full(lib.n_joints, NOISE))
    residual_noise: Noise | None = noise_of(lib, moved)
    known = replace(Knowledge.of(lib), payload_only=payload_only)
    if residual_noise is not None:
        known = replace(known, pi=residual_noise.pi, error=residual_noise.error)
    from_residuals = given is None and residual_noise is not None
    sigma = residual_noise.sigma if from_residuals and residual_noise is not None else planned.sigma
    if earlier:
        logs = [read_recording(log, joints=lib.joint_names) for log in earlier]
        known = replace(known, earlier=information_of_logs(lib, logs, sigma, moved.columns))
    unit = planned.rows_per_independent(moved.rate)
    if residual_noise is not None and planned.log is None:
        unit = residual_noise.inflation
    return Situation(lib, moved, sigma, unit, from_residuals, planned, known)
