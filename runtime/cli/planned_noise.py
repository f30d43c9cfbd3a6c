"""The option --noise of a planned motion: numbers, or a log whose residuals are its noise.

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
from runtime.errors import IdentificationError
from runtime.excitation.search.information import FRICTION, Information, information
from runtime.excitation.search.noise_spectrum import NoiseSpectrum, spectrum_of
from runtime.identification.expected_accuracy.planned_samples import motion_samples_of, noise_of
from runtime.library import Array, Library
from runtime.recording import Friction

NOISE_HELP = (
    "Torque noise: its standard deviation in N·m or N, one number or one per joint with commas, "
    "without model error; or a log of this robot, whose residuals contain friction beyond the "
    "columns, gains and delays, with their autocorrelation"
)
"""Help of the option."""
WHITE, COLOURED = "white", "coloured"
NoiseModel = Annotated[
    str,
    typer.Option(
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


@dataclass(frozen=True, slots=True)
class TorqueNoise:
    """Noise of the torque of a planned motion.

    Attributes:
        sigma: (n,) N·m or N.
        spacing: time between independent rows, s; 0 where all rows are independent.
        log: name of the log that it is from; None for numbers.
        spectrum: of the noise of a log, for --noise-model coloured.
    """

    sigma: Array
    spacing: float = 0.0
    log: str | None = None
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
            f"expected --noise-model {WHITE} or {COLOURED}, got '{model:.40}'; correct it"
        )
    words = text.split(",")
    if all(_is_number(word) for word in words):
        if model == COLOURED:
            raise IdentificationError(
                f"--noise-model {COLOURED} takes the spectrum from a log; give --noise LOG"
            )
        count = lib.n_joints if len(words) > 1 else 1
        sigma = np.array(numbers_option(text, count, "--noise"))
        return TorqueNoise(information(lib, np.broadcast_to(sigma, lib.n_joints)).noise)
    from runtime.cli.prepared_log import LogOptions, read_prepared_log  # imports the inspection

    names = FRICTION if friction is None else friction
    data = read_prepared_log(lib, text, LogOptions(friction=",".join(names) or "none"))
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


def counted(planned: Information, criterion: str, is_informed: bool) -> Information | None:
    """Information for a criterion; None where it is of the regressor alone."""
    if planned.spectrum is not None and not is_informed:
        raise IdentificationError(
            f"criterion {criterion} counts neither noise nor filter; leave out --cutoff and "
            "--noise-model, or give another --criterion such as v"
        )
    return planned if is_informed else None


def with_spectrum(planned: Information, noise: TorqueNoise, cutoff: float | None) -> Information:
    """Information with the spectrum of the noise and the planned filter."""
    if noise.spectrum is None and cutoff is None:
        return planned
    n = len(planned.noise)
    spectrum = noise.spectrum or NoiseSpectrum(np.zeros(0), np.zeros((0, n)))
    if cutoff is not None:
        spectrum = replace(spectrum, cutoff_hz=cutoff)
    return replace(planned, spectrum=spectrum)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
