"""The option --noise of a planned motion: numbers, or a log whose residuals are its noise.

    σ_j = RMS of the residuals of joint j,    T = (N / N_eff) / f

A log of the robot contains its model error: friction beyond the columns, gains, delays. Its
residuals are autocorrelated, so that only one row per T counts as independent. Numbers are
independent noise alone.
"""

from dataclasses import dataclass

import numpy as np

from runtime.cli.common import numbers_option
from runtime.errors import IdentificationError
from runtime.excitation.search.information import FRICTION, information
from runtime.identification.expected_accuracy import motion_samples_of, noise_of
from runtime.library import Array, Library
from runtime.recording import Friction

NOISE_HELP = (
    "Torque noise: its standard deviation in N·m, one number or one per joint with commas, without "
    "model error; or a log of this robot, whose residuals contain friction beyond the columns, "
    "gains and delays, with their autocorrelation"
)
"""Help of the option."""


@dataclass(frozen=True, slots=True)
class TorqueNoise:
    """Noise of the torque of a planned motion.

    Attributes:
        sigma: (n,) N·m or N.
        spacing: time between independent rows, s; 0 where all rows are independent.
        log: name of the log that it is from; None for numbers.
    """

    sigma: Array
    spacing: float = 0.0
    log: str | None = None

    def rows_per_independent(self, rate: float) -> float:
        """Rows that count as one independent row.

        Args:
            rate: of the rows, Hz.

        Returns:
            At least 1.
        """
        return max(1.0, rate * self.spacing)

    def sentence(self) -> str:
        """Sentence on what σ does not contain; empty for the noise of a log."""
        if self.log is not None:
            return ""
        return (
            "note: σ counts independent torque noise alone; friction beyond the columns, gains and "
            "delays make real errors larger. --noise LOG, a log of this robot, counts its residuals"
        )


def planned_noise(lib: Library, text: str, friction: tuple[str, ...] | None = None) -> TorqueNoise:
    """Noise from the value of --noise.

    Args:
        lib: library of the robot.
        text: numbers with commas, N·m, or a log.
        friction: columns that are fitted to the log; None is `FRICTION`.

    Returns:
        The noise.

    Raises:
        RuntimeFault: a number is out of range, the log cannot be read, or it has no torque.
    """
    words = text.split(",")
    if all(_is_number(word) for word in words):
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
            "give another log, or the standard deviation in N·m"
        )
    return TorqueNoise(noise.sigma, noise.inflation / moved.rate, moved.name)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
