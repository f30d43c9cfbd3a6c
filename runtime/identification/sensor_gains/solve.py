"""min over θ, g, b of Σ_j ‖τᵐ_j − g_j (X_j θ + y_j) − b_j‖²/σ_j², on one triangle per channel.

Divided by g_j the problem is linear in (θ, a = 1/g): a_j τᵐ_j − y_j = X_j θ (Gautier & Briot 2014).
There the noise of τᵐ is among the columns and biases the solution, so that this form only gives the
start. In the form above the noise is additive, so that Gauss–Newton on (θ, g) with σ_j from the
residuals is maximum likelihood. b_j, one per run, is eliminated by subtracting means.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from runtime.library import Array

_ITERATIONS = 60
_CONVERGED = 1e-9
_HALVINGS = 30
_UNSEEN = 1e-9
"""Relative singular value below which a direction of the scaled unknowns counts as not excited. Its
σ is computed with this value, which every threshold rejects."""
_PERFECT = 1e-9
"""Noise relative to the largest channel below which data count as exact."""


@dataclass(frozen=True, slots=True)
class Solution:
    """Maximum likelihood solution.

    Attributes:
        theta: θ, (p,).
        g: gains, (n,).
        root: R (p + n, p + n), R Rᵀ the covariance of (θ, g) for white noise.
        noise: σ_j, (n,) N·m or N.
        levels: means of [X, y, τᵐ] of every run and channel, (n, runs, p + 2).
        converged: whether the steps became small.
    """

    theta: Array
    g: Array
    root: Array
    noise: Array
    levels: Array
    converged: bool

    def rest(self, block: Array) -> Array:
        """Residual τᵐ − g (X θ + y) − b of rows [1 per run, X, y, τᵐ], (n, N)."""
        return _rest(self._centred(block), self.theta, self.g)

    def slopes(self, block: Array) -> Array:
        """∂(g (X θ + y) + b)/∂(θ, g) of the same rows, with b eliminated, (n, N, p + n)."""
        return _slopes(self._centred(block), self.theta, self.g)

    def offsets(self) -> tuple[Array, Array]:
        """Offsets b (runs, n) and their derivatives with respect to (θ, g), (runs, n, p + n)."""
        return _rest(self.levels, self.theta, self.g).T, -np.swapaxes(
            _slopes(self.levels, self.theta, self.g), 0, 1
        )

    def _centred(self, block: Array) -> Array:
        """[X, y, τᵐ] minus the means of their run."""
        k = self.levels.shape[1]
        return np.asarray(block[:, :, k:] - block[:, :, :k] @ self.levels)


def reduced(blocks: Iterable[Array]) -> Array:
    """Triangular factor of the rows of each channel, (n, w, w)."""
    pending = iter(blocks)
    triangle = np.asarray(np.linalg.qr(next(pending), mode="r"))
    for block in pending:
        rows = np.concatenate([triangle, block], axis=1)
        triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    return triangle


def solve(triangle: Array, n_samples: int, n_runs: int) -> Solution:
    """Gauss–Newton from the linear solution, with steps halved until the likelihood increases."""
    # Below the rows of the offsets, the triangle is that of the centred data.
    rows = triangle[:, n_runs:, n_runs:]
    n, p = len(rows), rows.shape[2] - 2
    freedom = max(n_samples - n_runs - (p + n) / n, 1.0)
    floor = (_PERFECT * np.linalg.norm(rows[:, :, -1])) ** 2 + np.finfo(float).tiny

    def power(x: Array) -> Array:
        return np.asarray(np.sum(_rest(rows, x[:p], x[p:]) ** 2, axis=1) + floor)

    x = np.concatenate(linear(rows))
    now, converged = power(x), False
    for _ in range(_ITERATIONS):
        # σ_j² = power_j / freedom: the log-likelihood is −½ freedom Σ_j ln power_j.
        weight = np.sqrt(freedom / now)[:, None]
        rest = weight * _rest(rows, x[:p], x[p:])
        step = _least_squares(weight[:, :, None] * _slopes(rows, x[:p], x[p:]), rest)
        for _ in range(_HALVINGS):
            after = power(x + step)
            if np.log(after).sum() <= np.log(now).sum():
                break
            step = step / 2
        x, now = x + step, after
        if np.linalg.norm(step[p:]) <= _CONVERGED * np.linalg.norm(x[p:]):
            converged = True
            break
    # Covariance of (θ, g), and the means from which the offsets follow.
    noise: Array = np.sqrt(now / freedom)
    slopes = _slopes(rows, x[:p], x[p:]) / noise[:, None, None]
    levels: Array = np.asarray(
        np.linalg.solve(triangle[:, :n_runs, :n_runs], triangle[:, :n_runs, n_runs:])
    )
    return Solution(x[:p], x[p:], _root(slopes), noise, levels, converged)


def linear(rows: Array) -> tuple[Array, Array]:
    """θ (p,) and g (n,) of min ‖a τᵐ − y − X θ‖², which noise biases."""
    n, p = len(rows), rows.shape[2] - 2
    matrix = np.zeros((*rows.shape[:2], p + n))
    matrix[:, :, :p] = -rows[:, :, :-2]
    matrix[np.arange(n), :, p + np.arange(n)] = rows[:, :, -1]
    theta, a = np.split(_least_squares(matrix, rows[:, :, -2]), [p])
    return theta, 1 / np.where(np.abs(a) > _UNSEEN, a, 1.0)


def _rest(rows: Array, theta: Array, g: Array) -> Array:
    """τᵐ − g (X θ + y), (n, rows)."""
    return np.asarray(rows[:, :, -1] - g[:, None] * (rows[:, :, :-2] @ theta + rows[:, :, -2]))


def _slopes(rows: Array, theta: Array, g: Array) -> Array:
    """∂(g (X θ + y))/∂(θ, g), (n, rows, p + n)."""
    n, p = len(rows), len(theta)
    J = np.zeros((*rows.shape[:2], p + n))
    J[:, :, :p] = g[:, None, None] * rows[:, :, :-2]
    J[np.arange(n), :, p + np.arange(n)] = rows[:, :, :-2] @ theta + rows[:, :, -2]
    return J


def _scaled(matrix: Array) -> tuple[Array, Array]:
    """Matrix (rows, columns) with columns of length 1, and the lengths."""
    flat = matrix.reshape(-1, matrix.shape[-1])
    norms = np.linalg.norm(flat, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    return flat / norms, norms


def _least_squares(matrix: Array, target: Array) -> Array:
    """Least squares with normalised columns."""
    flat, norms = _scaled(matrix)
    return np.asarray(np.linalg.lstsq(flat, target.ravel(), rcond=_UNSEEN)[0] / norms)


def _root(J: Array) -> Array:
    """R with R Rᵀ = (JᵀJ)⁻¹; very large in directions that are not excited."""
    flat, norms = _scaled(J)
    _, size, right = np.linalg.svd(flat, full_matrices=False)
    floor = max(_UNSEEN * float(size[0]), float(np.finfo(float).tiny) ** 0.25)
    return np.asarray(right.T / np.maximum(size, floor) / norms[:, None])
