"""What makes a regressor good, as functions of the eigenvalues of C = D^-½ WᵀW D^-½, D = diag WᵀW.

C is the Gram matrix of W with columns of unit length. Each criterion takes the eigenvalues,
ascending and positive, and returns its value f and ∂f/∂λ.
"""

from collections.abc import Callable

import numpy as np

from runtime.library import Array

Criterion = Callable[[Array], tuple[float, Array]]


def log_cond(values: Array) -> tuple[float, Array]:
    """½ log λ_max/λ_min = log cond W̄ (Eq. 3.29). Not smooth where extremes meet."""
    slope = np.zeros_like(values)
    slope[-1] += 0.5 / values[-1]
    slope[0] -= 0.5 / values[0]
    return float(np.log(values[-1] / values[0]) / 2), slope


def d_optimal(values: Array) -> tuple[float, Array]:
    """−½ mean log λ: zero when all columns are orthogonal; smooth, and sees all eigenvalues."""
    return float(-np.log(values).mean() / 2), -0.5 / (len(values) * values)


def schatten(power: float) -> Criterion:
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


def of_rows(rows: Array, criterion: Criterion) -> tuple[float, Array]:
    """f and S with ∂f/∂W = W S, (n_b, n_b), for W (N, n_b).

    Columns of no full rank, to rounding, count as λ = n_b ε λ_max.
    """
    gram = rows.T @ rows
    size = np.sqrt(np.diag(gram))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    values, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    values = np.maximum(values, len(gram) * np.finfo(float).eps * values[-1])
    value, weights = criterion(values)
    z = vectors * scale[:, None]
    slope = 2 * (z * weights) @ z.T
    slope -= np.diag(2 * (z * z) @ (weights * values))
    return value, slope


def log_condition(rows: Array) -> tuple[float, Array]:
    """log cond W̄ and S with ∂/∂W = W S, (n_b, n_b); W̄ is W (N, n_b) with columns of unit length."""
    return of_rows(rows, log_cond)
