"""Weighted torque loss over samples, and its gradient.

L(λ, φ) = (1/N) Σ ½ rᵀ W r,  r = Y π(λ) + F φ − τ (Eqs. 4.5, 4.6), with friction F φ as an option.
The unknowns are x = [λ, ψ]: φ = ψ · unit, where one unit of ψ moves the torque of its joint by as
much as a relative change of one in λ does, so that one step size serves both.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.regression.samples import THESIS_SIGMA, Samples
from runtime.library import Array, Library
from runtime.recording import friction


class TorqueObjective:
    """L(x) and ∇L(x) over all samples or over a mini-batch."""

    def __init__(
        self, lib: Library, samples: Samples, weights: Array, unit: Array | None = None
    ) -> None:
        self.lib, self.samples, self.weights = lib, samples, weights
        self.n_lam = lib.lam0.size
        self.shape = samples.columns.shape[1:]
        self.unit = friction_unit(samples) if unit is None else unit

    def split(self, x: Array) -> tuple[Array, Array]:
        """λ (10 n,) and φ (n, k) of x."""
        return x[: self.n_lam], x[self.n_lam :].reshape(self.shape) * self.unit

    def join(self, lam: Array, phi: Array) -> Array:
        """Unknowns x of λ and φ.

        lam (10 n,), phi (n, k) → (10 n + n k,) [λ, ψ].
        """
        return np.concatenate([lam, (phi / self.unit).ravel()])

    def value_gradient(
        self, x: Array, rows: NDArray[np.int64] | None = None
    ) -> tuple[float, Array]:
        """Loss and gradient.

        x (10 n + n k,) [λ, ψ].
        """
        lam, phi = self.split(x)
        s, lib = self.samples, self.lib
        take = slice(None) if rows is None else rows
        q, dq, ddq, tau, columns = (a[take] for a in (s.q, s.dq, s.ddq, s.tau, s.columns))
        free = tau - friction.torque(columns, phi, s.coupling) if phi.size else tau
        pi = lib.pi_from_lam(lam)
        loss, slope, residual = lib.loss_gradient(q, dq, ddq, free, self.weights, pi)
        n_lam = lib.pi_adjoint(lam, slope)
        n_phi = _slope(columns, residual * self.weights, s.coupling) * self.unit
        return loss / len(q), np.concatenate([n_lam, n_phi.ravel()]) / len(q)

    def value(self, x: Array) -> float:
        """Loss L at x over all samples."""
        lam, phi = self.split(x)
        s = self.samples
        residual = s.rigid(self.lib, self.lib.pi_from_lam(lam)) - s.tau
        if phi.size:
            residual = residual + s.friction(phi)
        return float(np.mean((residual**2) @ self.weights) / 2)


def _slope(columns: Array, weighted: Array, coupling: friction.Coupling | None) -> Array:
    """Σ_i Cᵀ W r of every coefficient, (n, k)."""
    if coupling is None:
        return np.asarray(np.einsum("ijk,ij->jk", columns, weighted))
    return coupling.slope(columns, weighted)


def friction_unit(samples: Samples) -> Array:
    """Units of φ, (n, k): RMS torque of the joint over RMS of the column, 1 for a zero column."""
    torque = np.sqrt(np.mean(samples.tau**2, axis=0) + THESIS_SIGMA**2)
    rms = np.sqrt(np.mean(samples.columns**2, axis=0))
    if samples.coupling is not None:
        rms = samples.coupling.sizes(rms)
    return torque[:, None] / np.where(rms > 0, rms, 1.0)
