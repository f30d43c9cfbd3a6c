"""Motions q(t) = home + Σ_m a_m φ_m(t) per joint, at rest at both ends (Eqs. 3.24–3.28)."""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.motion.basis import COSINE, Basis
from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Motion q(t) of n joints from `home`, at rest at both ends; back to it with most bases.

    Attributes:
        home: (n,) rad or m.
        coefficients: a, (n, M) rad or m.
        duration: t_f, s.
        basis: functions φ.
    """

    home: Array
    coefficients: Array
    duration: float
    basis: Basis = COSINE

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """States at given times.

        Args:
            lib: the robot.
            t: times, (N,) s.

        Returns:
            q, dq, ddq, dddq, (N, n) each.
        """
        basis = self.basis.at(lib, self.coefficients.shape[1], t, self.duration)
        q, dq, ddq, dddq = np.einsum("jm,tmd->dtj", self.coefficients, basis)
        return q + self.home, dq, ddq, dddq


MOST_SAMPLES = 10_000_000
"""Largest number of samples: more exceed the memory of an ordinary computer."""


def sample_times(duration: float, rate_hz: float) -> Array:
    """Times 0, 1/rate, … up to the duration.

    Args:
        duration: s.
        rate_hz: sampling rate, Hz.

    Returns:
        (N,) s.

    Raises:
        IdentificationError: values that make no clock, or one of more than `MOST_SAMPLES`.
    """
    samples = duration * rate_hz
    if not (duration > 0 and rate_hz > 0 and samples < MOST_SAMPLES):
        raise IdentificationError(
            "a motion needs a positive duration and sampling rate that make fewer than "
            f"{MOST_SAMPLES:,} samples, got {duration:g} s and {rate_hz:g} Hz"
        )
    return np.arange(round(samples) + 1) / rate_hz
