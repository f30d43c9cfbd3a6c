"""Motions q(t) = home + Σ_m a_m φ_m(t) per joint, at rest at both ends (Eqs. 3.24–3.28)."""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class Trajectory:
    """q(t) of n joints: out from `home` and back to it at rest.

    Attributes:
        home: (n,) rad or m.
        coefficients: a, (n, M) rad or m.
        duration: t_f, s.
    """

    home: Array
    coefficients: Array
    duration: float

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """q, dq, ddq, dddq at times t, each (N, n)."""
        basis = fourier_basis(lib, self.coefficients.shape[1], t, self.duration)
        q, dq, ddq, dddq = np.einsum("jm,tmd->dtj", self.coefficients, basis)
        return q + self.home, dq, ddq, dddq


def fourier_basis(lib: Library, harmonics: int, t: Array, duration: float) -> Array:
    """φ_m(t) and three derivatives, (N, M, 4)."""
    m = np.arange(1, harmonics + 1, dtype=float)
    times, orders = np.repeat(t, harmonics), np.tile(m, len(t))
    return lib.harmonic_basis(orders, times, duration).reshape(len(t), harmonics, 4)
