"""Quality of a regressor W: functions of its Gram matrix G = WᵀW.

Two kinds. A `SpectralFunction` takes the eigenvalues λ, ascending and positive, of the Gram matrix
C = D^-½ G D^-½, D = diag G, of columns of unit length, and returns f and ∂f/∂λ: lengths of columns
have no effect. The others are functions of the covariance G⁻¹ of least squares. As a `Measure`
either takes G and returns f and S = 2 ∂f/∂G, so that ∂f/∂W = W S.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack

from runtime.library import Array

SpectralFunction = Callable[[Array], tuple[float, Array]]
Measure = Callable[[Array], tuple[float, Array]]


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
