"""The base regressor along a trajectory as a function of its coefficients, and the costs of it."""

import numpy as np

from runtime.excitation.criteria import Criterion, log_cond, of_rows
from runtime.excitation.trajectory import fourier_basis
from runtime.library import Array, Library

COST_SAMPLES = 80
"""Samples of the cost over the whole duration (document Sec. 3.4.2)."""
_CHUNK = 16
"""Trajectories per batch: their regressors stay in the cache."""


class ConditionCost:
    """log cond W̄_b of a trajectory and its exact gradient in a (Eq. 3.29).

    Columns of no full rank, to rounding, count as cond = (n_b ε)^-½. Compiled where the library's
    level has it, else by NumPy.
    """

    def __init__(self, lib: Library, home: Array, harmonics: int, duration: float) -> None:
        self._lib, self._home = lib, home
        # Out and back passes every sample twice; half of them carry all the information.
        t = np.linspace(0.0, duration, COST_SAMPLES)[: COST_SAMPLES // 2]
        self._basis = fourier_basis(lib, harmonics, t, duration)[..., :3]
        self.compiled = lib.excitation_cost(home, self._basis)

    def value_gradient(self, coefficients: Array) -> tuple[float, Array]:
        """Cost and ∂cost/∂a, (n, M)."""
        if self.compiled is not None:
            return self.compiled.value_gradient(coefficients)
        return self.by_numpy(coefficients)

    def by_numpy(self, coefficients: Array) -> tuple[float, Array]:
        """The same with LAPACK's eigenpairs: the reference."""
        return self.criterion(coefficients, log_cond)

    def criterion(self, coefficients: Array, criterion: Criterion) -> tuple[float, Array]:
        """Any criterion of the eigenvalues and its gradient in a, (n, M)."""
        motion, rows = self._regressor(coefficients[None])
        value, slope = of_rows(rows[0], criterion)
        return value, self._back(motion, (rows[0] @ slope)[None])[0]

    def correlations(self, coefficients: Array) -> Array:
        """C = W̄ᵀW̄ of K trajectories, (K, n_b, n_b), from a (K, n, M)."""
        return _normalised(self._regressor(coefficients)[1])[0]

    def correlations_slopes(self, coefficients: Array, weight: Array) -> tuple[Array, Array]:
        """C and ∂⟨F, C⟩/∂a for a constant symmetric F, (K, n_b, n_b) and (K, n, M)."""
        matrices, slopes = [], []
        for first in range(0, len(coefficients), _CHUNK):
            motion, rows = self._regressor(coefficients[first : first + _CHUNK])
            correlation, scale = _normalised(rows)
            # C depends on W also through the lengths of its columns: the diagonal of F C.
            slope = 2 * weight - 2 * np.einsum("ij,kij->ki", weight, correlation)[:, None, :] * (
                np.eye(len(weight))
            )
            slope *= scale[:, :, None] * scale[:, None, :]
            matrices.append(correlation)
            slopes.append(self._back(motion, rows @ slope))
        return np.concatenate(matrices), np.concatenate(slopes)

    def _regressor(self, a: Array) -> tuple[Array, Array]:
        """q, dq, ddq (3, K N, n) and W (K, N n, n_b) of K trajectories."""
        motion = np.einsum("kjm,tmd->dktj", a, self._basis)
        motion[0] += self._home
        motion = motion.reshape(3, -1, motion.shape[-1])
        y = self._lib.base_regressor(*motion)
        return motion, y.reshape(len(a), -1, y.shape[-1])

    def _back(self, motion: Array, seed: Array) -> Array:
        """∂⟨seed, W⟩/∂a, (K, n, M)."""
        samples, n = motion.shape[1:]
        q, dq, ddq = motion
        adjoint = self._lib.regressor_adjoint(q, dq, ddq, seed.reshape(samples, n, -1))
        adjoint = adjoint.reshape(len(seed), -1, 3, n)
        return np.einsum("ktdj,tmd->kjm", adjoint, self._basis, optimize=True)


def _normalised(rows: Array) -> tuple[Array, Array]:
    """C and 1 / column lengths, (K, n_b, n_b) and (K, n_b)."""
    gram = rows.transpose(0, 2, 1) @ rows
    size = np.sqrt(np.einsum("kii->ki", gram))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    return gram * (scale[:, :, None] * scale[:, None, :]), scale
