"""The base regressor along a trajectory as a function of its coefficients, and costs of it."""

import numpy as np

from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.excitation.search import information as info
from runtime.excitation.search.measures import Measure, log_cond, normalised, of_unit_length
from runtime.library import Array, Library
from runtime.library.compiled_programs import CompiledExcitation

COST_SAMPLES = 80  # samples of the cost over the whole duration (document Sec. 3.4.2)
INFORMED_SAMPLES = 240
"""Samples of a cost that counts noise and friction, over the whole duration.

With 80 the search finds motions that are good at these samples: the expected torque error of a
design for criterion a was a quarter larger over 1000 samples than over 80. With 240 it is 2 %.
"""
_CHUNK = 16  # trajectories per batch: their regressors stay in the cache


class ConditionCost:
    """log cond W̄_b of a trajectory and its exact gradient in a (Eq. 3.29).

    Columns without full rank, to rounding, count as cond = (n_b ε)^-½. Compiled where the library's
    level has it, else by NumPy. With `information` the Gram matrix is that of the unknowns which it
    names, in units of their inverse covariance, with the information of earlier logs added and with
    its friction columns projected out.
    """

    def __init__(
        self,
        lib: Library,
        home: Array,
        harmonics: int,
        duration: float,
        basis: Basis = COSINE,
        information: info.Information | None = None,
    ) -> None:
        """Cost for motions of one basis and duration."""
        self._lib, self._home = lib, home
        t = np.linspace(0.0, duration, COST_SAMPLES if information is None else INFORMED_SAMPLES)
        if basis.is_symmetric:
            # A motion out and back passes every sample twice: half of them suffice.
            t = t[: len(t) // 2]
        self._basis = basis.at(lib, harmonics, t, duration)[..., :3]
        self._information, self._duration = information, duration
        self._rows = None
        self._filtered: Array | None = None
        self._nuisance: tuple[str, ...] = ()
        if information is not None:
            self._rows = 1 / (information.noise * np.sqrt(len(t)))
            if information.spectrum is not None:
                self._filtered = information.spectrum.weighted_cosines(len(t), float(t[1] - t[0]))
            names = information.friction
            self._nuisance = info.even_columns(names) if basis.is_symmetric else names
        self.compiled = None
        if information is None:
            self.compiled = CompiledExcitation.of(lib.binding, home, self._basis)

    def value_gradient(self, coefficients: Array) -> tuple[float, Array]:
        """Cost and gradient ∂cost/∂a, (n, M)."""
        if self.compiled is not None:
            return self.compiled.value_gradient(coefficients)
        return self.by_numpy(coefficients)

    def by_numpy(self, coefficients: Array) -> tuple[float, Array]:
        """The same with the eigenpairs of LAPACK: the reference."""
        return self.measure(coefficients, normalised(log_cond))

    def measure(self, coefficients: Array, measure: Measure) -> tuple[float, Array]:
        """Any measure of the Gram matrix.

        Args:
            coefficients: a, (n, M).
            measure: function of the Gram matrix.

        Returns:
            Its value and its gradient in a, (n, M).
        """
        motion, rows, friction = self._regressor(coefficients[None])
        value, slope = measure(self._of_mean(rows[0].T @ rows[0]))
        return value, self._back(motion, (rows[0] @ self._to_mean(slope))[None], friction)[0]

    def correlations(self, coefficients: Array) -> Array:
        """Matrices C = W̄ᵀW̄ of K trajectories, (K, n_b, n_b), from a (K, n, M)."""
        rows = self._regressor(coefficients)[1]
        return of_unit_length(self._of_mean(rows.transpose(0, 2, 1) @ rows))[0]

    def correlations_slopes(self, coefficients: Array, weight: Array) -> tuple[Array, Array]:
        """Matrices C and gradients of ⟨F, C⟩ for a constant symmetric F.

        Args:
            coefficients: a of K trajectories, (K, n, M).
            weight: F, (n_b, n_b).

        Returns:
            C, (K, n_b, n_b), and ∂⟨F, C⟩/∂a, (K, n, M).
        """
        matrices, slopes = [], []
        for first in range(0, len(coefficients), _CHUNK):
            motion, rows, friction = self._regressor(coefficients[first : first + _CHUNK])
            correlation, scale = of_unit_length(self._of_mean(rows.transpose(0, 2, 1) @ rows))
            # C depends on W also through the lengths of its columns: the diagonal of F C.
            slope = 2 * weight - 2 * np.einsum("ij,kij->ki", weight, correlation)[:, None, :] * (
                np.eye(len(weight))
            )
            slope *= scale[:, :, None] * scale[:, None, :]
            matrices.append(correlation)
            slopes.append(self._back(motion, rows @ self._to_mean(slope), friction))
        return np.concatenate(matrices), np.concatenate(slopes)

    def _regressor(self, a: Array) -> tuple[Array, Array, info.Projection | None]:
        """States q, dq, ddq (3, K N, n), W (K, N n, n_b) of K trajectories, and its projection."""
        motion = np.einsum("kjm,tmd->dktj", a, self._basis)
        motion[0] += self._home
        samples, n = motion.shape[2:]
        y = self._lib.base_regressor(*motion.reshape(3, -1, n))
        friction = None
        if self._filtered is not None:
            y = info.in_time(self._filtered, y.reshape(len(a), samples, n, -1)).reshape(y.shape)
        if self._nuisance:
            rows = y.reshape(len(a), samples, n, -1)
            friction = info.projected(rows, motion[1], self._nuisance, self._filtered)
            y = friction.rows.reshape(-1, n, y.shape[-1])
        if self._rows is not None:
            y = y * self._rows[:, None]
        return motion.reshape(3, -1, n), y.reshape(len(a), -1, y.shape[-1]), friction

    def _back(self, motion: Array, seed: Array, friction: info.Projection | None) -> Array:
        """Gradients ∂⟨seed, W⟩/∂a, (K, n, M)."""
        samples, n = motion.shape[1:]
        q, dq, ddq = motion
        seed = seed.reshape(samples, n, -1)
        if self._rows is not None:
            seed = seed * self._rows[:, None]
        of_rows = seed
        if self._filtered is not None:
            apart = seed.reshape(-1, len(self._basis), n, seed.shape[-1])
            of_rows = info.in_time(self._filtered.transpose(0, 2, 1), apart).reshape(seed.shape)
        adjoint = self._lib.regressor_adjoint(q, dq, ddq, of_rows)
        adjoint = adjoint.reshape(-1, len(self._basis), 3, n)
        if friction is not None:
            adjoint[:, :, 1] += friction.seed_of_speed(seed.reshape(friction.rows.shape))
        # Σ over samples and derivatives, (K, n, M).
        return np.tensordot(adjoint, self._basis, axes=([1, 2], [0, 2]))

    def _of_mean(self, gram: Array) -> Array:
        known = self._information
        return gram if known is None else known.of_mean(gram, self._duration)

    def _to_mean(self, slope: Array) -> Array:
        known = self._information
        return slope if known is None else known.to_mean(slope, self._duration)
