"""Error of a model beside its noise: scatter of scores between blocks, and nuisance torque.

For scores z = Qᵀ r of an orthonormal basis Q, with blocks of `BLOCK_S` and p columns:

    V = (1 − w) c 1 + w M,   M = K/(K−1) Σ_k z_k z_kᵀ,   c = max(S, tr M / p),   w = min(1, K / 5 p)

White residuals of density S have V = S 1. Few blocks determine the mean variance c of all
directions, and each direction alone only from five blocks per column on. In the coordinates of the
rows, V takes the place of S, so that the posterior of any prior has the covariance A⁻¹ V A⁻ᵀ of
least squares and the prior stays what it is. What repeats with the posture does so in every block:
it is the torque of nuisance shapes (`nuisance`), and is taken out of r before. Torque gains are
1 + s with s ~ N(0, σ²): N_j = τ̂_j is a shape of the rows of joint j, with the posterior of shapes
and level c. A common factor is in none of r; σ is that of joints of one make, so that what the
joints contradict each other by determines it: σ² is exponentially distributed about the expected
one before, and its posterior mean after, which counts where it is smaller.
Source: Cameron & Miller 2015 for blocks, Ledoit & Wolf 2004 for the shrinkage.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.regression.coloured_noise import coloured_noise_of_shares
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.nuisance import common_size, nuisance_of, size_posterior
from runtime.estimators.regression.omitted_columns import FreeFit
from runtime.estimators.regression.posterior import APART, ROUNDING, posterior_of
from runtime.estimators.regression.samples import Samples
from runtime.estimators.regression.slow_rows import time_step
from runtime.library import Array, Library

BLOCK_S, FEWEST, PER_COLUMN = 2.0, 3, 5
"""Length of a block, of which 1 and 5 s give the same σ to 15 % on an industrial arm [s]; number of
blocks from which on their scatter counts, and per column for directions of their own."""
LEAST = 0.25
"""Smallest variance of a direction over that of the noise: fewer rows turn its axes a little."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelError:
    """What the posterior of a fit gains beside its noise."""

    statistics: Statistics  # rows over (V / S)^½
    # Σ Xᵀ W N λ over all samples, whose product with (XᵀWX)⁻¹ is a root of the covariance of
    # nuisance torque, (n_b + n k, m)
    slopes: Array
    gains: int = 0  # number of the last of them, those of torque gains
    gain_sigma: float = 0.0  # their relative σ by the residual


def model_error_of(
    lib: Library, fit: FreeFit | None, pi: Array, statistics: Statistics, gain_sigma: float = 0.0
) -> ModelError:
    """Error of the model in the information of a fit, from a free fit to some of its samples.

    gain_sigma: expected relative σ of every torque gain.
    """
    size = len(statistics.target)
    none = ModelError(statistics, np.zeros((size, 0)))
    if fit is None or len(fit.root) != size:
        return none
    count, n = len(fit.samples), fit.scale.size
    rest, p = fit.rest.reshape(count, n), fit.basis.shape[1]
    density = coloured_noise_of_shares(fit.shares, rest, p).density
    if not density > 0:
        return none
    torque = nuisance_of(lib, fit, pi, density)
    rest = rest - torque.mean.reshape(count, n)
    spread = scatter(fit.samples, fit.basis, rest, density)
    gains = np.zeros((p, 0))
    if gain_sigma and fit.samples.base is None and fit.samples.equations == lib.n_joints:
        predicted, level = fit.predicted.reshape(count, n), float(np.trace(spread)) / p
        taken = np.einsum("ijk,ij->kj", fit.basis.reshape(count, n, p), predicted)
        gains, gain_sigma = gain_error(taken, predicted, rest, level, gain_sigma)
    # From the coordinates of Q to those of the rows A: A R = U is orthonormal, X R_Q = Q.
    whole = posterior_of(statistics.factor, rank=APART)
    u = statistics.factor @ whole.root
    turn = whole.root.T @ np.linalg.pinv(fit.root, rcond=ROUNDING).T
    if not turn.any():
        return none
    turn /= np.linalg.norm(turn) / np.sqrt(len(turn))
    excess = turn @ (spread / density - np.eye(p)) @ turn.T
    sizes, axes = np.linalg.eigh(excess)
    smaller = axes * (1 / np.sqrt(1 + np.maximum(sizes, LEAST - 1)) - 1)
    rows = np.column_stack([statistics.factor, statistics.target])
    rows = rows + u @ (smaller @ (axes.T @ (u.T @ rows)))
    changed = replace(statistics, factor=rows[:, :-1], target=rows[:, -1])
    scores = fit.root @ np.hstack([torque.error, gains])
    slopes = changed.factor.T @ (changed.factor @ scores)
    return ModelError(changed, slopes, gains.shape[1], gain_sigma)


def gain_error(
    taken: Array, torque: Array, rest: Array, level: float, expected: float
) -> tuple[Array, float]:
    """Errors Qᵀ N [C_s^½, s̄] of torque gains, (p, n + 1), and their σ by the residual.

    taken (p, n) Qᵀ N, torque (N, n) and residuals (N, n) of variance level over their weights.
    """
    gram = np.diag(np.sum(torque**2, axis=0)) - taken.T @ taken
    z, n = np.sum(torque * rest, axis=0), torque.shape[1]
    sigma = common_size(gram, z, level, expected)
    root, mean = size_posterior(gram, z, level, np.full(n, sigma))
    return taken @ np.column_stack([root, mean]), sigma


def scatter(samples: Samples, basis: Array, rest: Array, density: float) -> Array:
    """V of the scores of an orthonormal basis (N n, p) and residuals (N, n), (p, p)."""
    count, n = rest.shape
    p = basis.shape[1]
    blocks = np.arange(count) * time_step(samples) // BLOCK_S
    starts = np.flatnonzero(np.diff(blocks, prepend=-1.0))
    k = len(starts)
    if k < FEWEST:
        return density * np.eye(p)
    scores = np.einsum("ijk,ij->ik", basis.reshape(count, n, p), rest)
    each = np.add.reduceat(scores, starts, axis=0)
    meat = each.T @ each * (k / (k - 1))
    level, share = max(density, float(np.trace(meat)) / p), min(1.0, k / (PER_COLUMN * p))
    return np.asarray((1 - share) * level * np.eye(p) + share * meat)
