"""A motion on a grid of time, with suprema of its derivatives on intervals."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from runtime.excitation import Trajectory
from runtime.excitation.motion.family import Basis
from runtime.library import Array

STEP = 1e-3
"""Longest interval, s."""
INTERVALS = 2000
"""Fewest intervals, however short the motion."""
ORDERS = 5
"""Number of derivatives of the motion that are evaluated, q included."""
ROUNDING = 64 * np.finfo(float).eps
"""Relative to the largest value: the arguments 2πms carry a few ε, and M products are added."""


class MotionGrid:
    """A motion on a grid of `count` intervals; `sup` bounds its derivatives, (6, n)."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory, a = trajectory, trajectory.coefficients
        basis, duration = trajectory.basis, trajectory.duration
        count = max(INTERVALS, int(np.ceil(duration / STEP)))
        self.count = count + count % 2
        self.step = duration / self.count
        powers = duration ** -np.arange(ORDERS + 1.0)
        bounds = np.array([basis.bound(k, a.shape[1]) for k in range(ORDERS + 1)])
        self.sup = bounds @ np.abs(a).T * powers[:, None]
        self._weights = a.T * powers[:-1, None, None]

    def between(self, first: int, last: int) -> Array:
        """States q and derivatives at neighbouring samples."""
        basis, size = self._trajectory.basis, self._weights.shape[1]
        return self._moved(_phi(basis, size, first, last, self.count))

    def at(self, samples: NDArray[np.intp], parts: int = 1) -> Array:
        """States q and derivatives at any instants.

        samples (N,) → (5, N, n).
        """
        s = samples / (self.count * parts)
        return self._moved(self._trajectory.basis.derivatives(ORDERS, self._weights.shape[1], s))

    def suprema(self, first: Array, last: Array, step: float) -> Array:
        """Bounds of |q| and five derivatives on intervals: the larger end, and half a step of more.

        first (5, K, n) → (6, K, n).
        """
        bounds = np.empty((ORDERS + 1, *first.shape[1:]))
        np.maximum(np.abs(first), np.abs(last), out=bounds[:ORDERS])
        bounds[ORDERS] = self.sup[ORDERS]
        for order in reversed(range(ORDERS)):
            bounds[order] += step / 2 * bounds[order + 1] + ROUNDING * self.sup[order]
        # A long interval of a fast motion: no derivative exceeds its bound over all t.
        np.minimum(bounds[1:], self.sup[1:, None], out=bounds[1:])
        return bounds

    def _moved(self, phi: Array) -> Array:
        motion = phi @ self._weights
        motion[0] += self._trajectory.home
        return motion


@lru_cache(maxsize=24)
def _phi(basis: Basis, size: int, first: int, last: int, count: int) -> Array:
    """Derivatives d^k φ_m/ds^k at neighbouring samples, shared by motions of this duration."""
    s = np.arange(first, last + 1) / count
    return basis.derivatives(ORDERS, size, s)
