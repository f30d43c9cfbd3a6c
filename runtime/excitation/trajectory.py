"""Motions q(t) = home + Σ_m a_m φ_m(t) per joint, at rest at both ends (Eqs. 3.24–3.28)."""

from dataclasses import dataclass

import numpy as np

from runtime.excitation.basis import COSINE, Basis
from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class Trajectory:
    """q(t) of n joints: from `home` and back to it, at rest at both ends.

    Attributes:
        home: (n,) rad or m.
        coefficients: a, (n, M) rad or m.
        duration: t_f, s.
        basis: of the functions φ.
    """

    home: Array
    coefficients: Array
    duration: float
    basis: Basis = COSINE

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """q, dq, ddq, dddq at times t, each (N, n)."""
        basis = self.basis.at(lib, self.coefficients.shape[1], t, self.duration)
        q, dq, ddq, dddq = np.einsum("jm,tmd->dtj", self.coefficients, basis)
        return q + self.home, dq, ddq, dddq
