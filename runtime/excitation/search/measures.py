"""Quality of a regressor W: functions of its Gram matrix G = WᵀW, and their slopes in a motion.

Two kinds. A `SpectralFunction` takes the eigenvalues λ, ascending and positive, of the Gram matrix
C = D^-½ G D^-½, D = diag G, of columns of unit length, and returns f and ∂f/∂λ: lengths of columns
have no effect. The others are functions of the covariance G⁻¹ of least squares. As a `Measure`
either takes G and returns f and S = 2 ∂f/∂G, so that ∂f/∂W = W S. A `ConditionCost` is a measure of
the base regressor along a trajectory as a function of its coefficients.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack

from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.excitation.search.information import (
    Information,
    Projection,
    even_columns,
    in_time,
    projected,
)
from runtime.library import Array, Library
from runtime.library.compiled_programs import CompiledExcitation

SpectralFunction = Callable[[Array], tuple[float, Array]]
Measure = Callable[[Array], tuple[float, Array]]

COST_SAMPLES = 80  # samples of the cost over the whole duration (document Sec. 3.4.2)
INFORMED_SAMPLES = 240
"""Samples of a cost that counts noise and friction, over the whole duration.

With 80 the search finds motions that are good at these samples: the expected torque error of a
design for criterion a was a quarter larger over 1000 samples than over 80. With 240 it is 2 %.
"""
_CHUNK = 16  # trajectories per batch: their regressors stay in the cache


def log_cond(values: Array) -> tuple[float, Array]:
    """½ log λ_max/λ_min = log cond W̄ (Eq. 3.29). Not smooth where extreme eigenvalues meet."""
    slope = np.zeros_like(values)
    slope[-1] += 0.5 / values[-1]
    slope[0] -= 0.5 / values[0]
    return float(np.log(values[-1] / values[0]) / 2), slope


def d_optimal(values: Array) -> tuple[float, Array]:
    """−½ mean log λ: zero when all columns are orthogonal; smooth, and depends on every λ."""
    return float(-np.log(values).mean() / 2), -0.5 / (len(values) * values)


def schatten(power: float) -> SpectralFunction:
    """(log Σ λ^p + log Σ λ^-p) / 2p: smooth, above log cond by at most log(n_b) / p."""

    def criterion(values: Array) -> tuple[float, Array]:
        log = np.log(values)
        total = slope = 0.0
        for sign in (1.0, -1.0):
            exponent = sign * power * log
            terms = np.exp(exponent - exponent.max())
            total += exponent.max() + np.log(terms.sum())
            slope = slope + sign * terms / terms.sum()
        return float(total / (2 * power)), slope / (2 * values)

    return criterion


def of_unit_length(gram: Array) -> tuple[Array, Array]:
    """Matrices C of columns of unit length, (…, n_b, n_b), and 1 / lengths of those of G."""
    size = np.sqrt(np.einsum("...ii->...i", gram))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    return gram * (scale[..., :, None] * scale[..., None, :]), scale


def normalised(criterion: SpectralFunction) -> Measure:
    """f of the eigenvalues of C as a function of G; without full rank λ counts as n_b ε λ_max."""

    def measure(gram: Array) -> tuple[float, Array]:
        unit, scale = of_unit_length(gram)
        values, vectors = np.linalg.eigh(unit)
        values = np.maximum(values, len(gram) * np.finfo(float).eps * values[-1])
        value, weights = criterion(values)
        z = vectors * scale[:, None]
        slope = 2 * (z * weights) @ z.T
        slope -= np.diag(2 * (z * z) @ (weights * values))
        return value, slope

    return measure


def covariance(gram: Array) -> Array | None:
    """Inverse G⁻¹, or None where G does not have full rank to rounding."""
    size = np.sqrt(np.diag(gram))
    if not (size > 0).all():
        return None
    upper, info = lapack.dpotrf(gram / np.outer(size, size))
    if info or not np.diag(upper).min() ** 2 > len(gram) * np.finfo(float).eps:
        return None
    inverse, _ = lapack.dpotri(upper)
    return np.asarray((np.triu(inverse) + np.triu(inverse, 1).T) / np.outer(size, size))


def log_variance(seen: Array) -> Measure:
    """½ log tr(Q G⁻¹), the log of an RMS error of torque or parameters; ∞ without full rank."""
    return log_variances((1.0, seen))


def log_variances(*terms: tuple[float, Array]) -> Measure:
    """Weighted sum of such logs, Σ weight · ½ log tr(Q G⁻¹), of one inverse."""

    def measure(gram: Array) -> tuple[float, Array]:
        inverse = covariance(gram)
        if inverse is None:
            return np.inf, np.zeros_like(gram)
        value, slope = 0.0, np.zeros_like(gram)
        for weight, seen in terms:
            total = float(np.sum(seen * inverse))
            value += weight * float(np.log(total) / 2)
            slope = slope + weight * (-(inverse @ seen @ inverse) / total)
        return value, slope

    return measure


def log_volume(gram: Array) -> tuple[float, Array]:
    """−½ mean log of the eigenvalues of G: log of the mean half-axis of the error ellipsoid."""
    inverse = covariance(gram)
    if inverse is None:
        return np.inf, np.zeros_like(gram)
    return float(-np.linalg.slogdet(gram)[1] / (2 * len(gram))), -inverse / len(gram)


def weighted(*terms: tuple[float, Measure]) -> Measure:
    """Weighted sum of measures: Σ weight · measure."""

    def measure(gram: Array) -> tuple[float, Array]:
        value, slope = 0.0, np.zeros_like(gram)
        for weight, term in terms:
            one, one_slope = term(gram)
            value, slope = value + weight * one, slope + weight * one_slope
        return value, slope

    return measure


def of_rows(rows: Array, criterion: SpectralFunction) -> tuple[float, Array]:
    """Function of the eigenvalues of C for a regressor (N, n_b)."""
    return normalised(criterion)(rows.T @ rows)


def log_condition(rows: Array) -> tuple[float, Array]:
    """Value log cond W̄ and S (n_b, n_b) with ∂/∂W = W S; W̄ is W (N, n_b) with unit columns."""
    return of_rows(rows, log_cond)


def mean_gram(rows: Array) -> Array:
    """Mean over samples of Y_kᵀ Y_k, (m, m), for Y (N, n, m)."""
    return np.einsum("tjk,tjl->kl", rows, rows, optimize=True) / len(rows)


def rank(gram: Array) -> int:
    """Number of independent columns, to rounding."""
    values = np.linalg.eigvalsh(of_unit_length(gram)[0])
    return int((values > len(gram) * np.finfo(float).eps * values[-1]).sum())


def too_many(excited: int, wanted: int, size: int) -> str:
    """Sentence about more unknowns than a motion excites."""
    return (
        f"the motion ({size} functions per joint) excites {excited} of {wanted} unknown columns; "
        "raise the setting harmonics, widen the range of positions, or leave out unknowns "
        "(friction, a payload that too few joints turn)"
    )


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
        information: Information | None = None,
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
            self._nuisance = even_columns(names) if basis.is_symmetric else names
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

    def _regressor(self, a: Array) -> tuple[Array, Array, Projection | None]:
        """States q, dq, ddq (3, K N, n), W (K, N n, n_b) of K trajectories, and its projection."""
        motion = np.einsum("kjm,tmd->dktj", a, self._basis)
        motion[0] += self._home
        samples, n = motion.shape[2:]
        y = self._lib.base_regressor(*motion.reshape(3, -1, n))
        friction = None
        if self._filtered is not None:
            y = in_time(self._filtered, y.reshape(len(a), samples, n, -1)).reshape(y.shape)
        if self._nuisance:
            rows = y.reshape(len(a), samples, n, -1)
            friction = projected(rows, motion[1], self._nuisance, self._filtered)
            y = friction.rows.reshape(-1, n, y.shape[-1])
        if self._rows is not None:
            y = y * self._rows[:, None]
        return motion.reshape(3, -1, n), y.reshape(len(a), -1, y.shape[-1]), friction

    def _back(self, motion: Array, seed: Array, friction: Projection | None) -> Array:
        """Gradients ∂⟨seed, W⟩/∂a, (K, n, M)."""
        samples, n = motion.shape[1:]
        q, dq, ddq = motion
        seed = seed.reshape(samples, n, -1)
        if self._rows is not None:
            seed = seed * self._rows[:, None]
        of_rows = seed
        if self._filtered is not None:
            apart = seed.reshape(-1, len(self._basis), n, seed.shape[-1])
            of_rows = in_time(self._filtered.transpose(0, 2, 1), apart).reshape(seed.shape)
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
