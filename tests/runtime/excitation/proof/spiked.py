"""Motions with a bump of a fraction of a millisecond: adversaries of checks at samples."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.library import Array

BUMP = Polynomial([1.0, 0.0, -1.0]) ** 8
"""(1 − x²)⁸ on −1..1: seven derivatives vanish at both ends."""


@dataclass(frozen=True, slots=True)
class Spiked(Basis):
    """The cosines, and a bump at `middle` of half the width `half`, both in units of t_f."""

    middle: float
    half: float
    zero_jerk: bool = False
    name = "spiked"
    is_symmetric = False
    equation = "cosines and a bump"

    def size(self, harmonics: int) -> int:
        return harmonics + 1

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        x = (s - self.middle) / self.half
        bumps = [
            np.where(np.abs(x) < 1, BUMP.deriv(k)(np.clip(x, -1, 1)), 0.0) / self.half**k
            for k in range(orders)
        ]
        cosines = COSINE.derivatives(orders, size - 1, s)
        return np.concatenate([cosines, np.array(bumps)[..., None]], axis=2)

    def bound(self, order: int, size: int) -> Array:
        slope = BUMP.deriv(order) if order else BUMP
        turns = slope.deriv().roots()
        real = turns.real[(np.abs(turns.imag) < 1e-3) & (np.abs(turns.real) <= 1)]
        # Multiple roots at ±1 are ill-conditioned, but the slope is flat there.
        peak = np.abs(slope(np.array([-1.0, 0.0, 1.0, *real]))).max() * (1 + 1e-6)
        return np.append(COSINE.bound(order, size - 1), peak / self.half**order)
