"""Nuisance torque that no column describes: cables, ripple, load, friction that peaks or bends.

    r = X x + N s + e,   s ~ N(0, Λ),   cov e = S

N are shapes of one joint each, with one λ for those of the posture and one for those of friction.
They maximise the marginal likelihood of what least squares over X leaves: with N' = N − X X⁺ N and
G = N'ᵀ N', the scores z = N'ᵀ r have the covariance S G + G Λ G. s is integrated out and not
exported: the estimate x̂ keeps its value, and its covariance gains that of X⁺ N s.
Source: Kennedy & O'Hagan 2001 for the discrepancy of a model; empirical Bayes for its size.
"""

import numpy as np

from runtime.estimators.regression.compression import Statistics
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

SLOW = 0.06
"""Speed at which friction peaks [rad/s, m/s]."""
KINDS = np.array([0, 0, 0, 0, 0, 1, 1, 1])
"""Kind of every shape, each with its λ: 0 of the posture (q, sin q, cos q, sin 2q, cos 2q), 1 of
friction (load, root of the speed, peak at low speed)."""
SHAPES = len(KINDS)
MOST_ROWS = 3000
"""Rows of a log from which λ is estimated, evenly spread."""
SIGNIFICANT = 4.6
"""Gain of 2 log p from which on a joint has nuisance torque: 5 % of logs that have none."""
SCALES = np.concatenate([[0.0], np.logspace(-6, 4, 31)])
"""Candidates of λ² over the variance with which the noise enters a shape."""


def nuisance_columns(lib: Library, pi: Array, samples: Samples) -> Array:
    """Shapes N, each of one joint and of size 1, (N, n, SHAPES n)."""
    q, dq = samples.q, samples.dq
    still = np.zeros_like(q)
    load = np.abs(lib.inverse_dynamics(q, still, still, pi))
    sign = np.tanh(dq / SLOW)
    each = [q, np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)]
    each += [load / np.maximum(load.max(axis=0), 1e-12) * sign]
    each += [np.sign(dq) * np.sqrt(np.abs(dq)), sign * np.exp(-((dq / SLOW) ** 2))]
    columns = np.stack(each, axis=2)[:, :, None, :] * np.eye(q.shape[1])[:, :, None]
    return np.asarray(columns.reshape(*q.shape, -1))


def nuisance_slopes(
    lib: Library, samples: Samples, pi: Array, statistics: Statistics, density: float
) -> Array:
    """Σ Xᵀ W N λ over all samples, whose product with (XᵀWX)⁻¹ is a root of the added covariance.

    pi (10 n,), density S → (n_b + n k, columns); no column without nuisance torque.
    """
    none = np.zeros((len(statistics.factor), 0))
    rows = np.linspace(0, len(samples) - 1, min(len(samples), MOST_ROWS)).astype(int)
    some = samples.rows(rows)
    share = len(samples) / len(rows)
    if samples.base is not None or samples.equations != lib.n_joints:
        return none
    x = np.concatenate([some.base_rows(lib), some.friction_rows()], axis=2)
    if x.shape[2] != len(statistics.factor.T):
        return none
    over = np.sqrt(_weights(x, statistics) / share)
    x *= over[:, None]
    fit = posterior_of(statistics.factor, statistics.target)
    known = x.reshape(-1, x.shape[2])
    columns = (nuisance_columns(lib, pi, some) * over[:, None]).reshape(len(known), -1)
    across = share * (known.T @ columns)
    apart = columns - known @ (fit.root @ (fit.root.T @ across))
    rest = (some.tau * over).ravel() - known @ fit.mean
    gram, z = share * (apart.T @ apart), share * (apart.T @ rest)
    kept = []
    for j in range(lib.n_joints):
        of_joint = slice(SHAPES * j, SHAPES * (j + 1))
        sizes = _sizes(gram[of_joint, of_joint], z[of_joint], density)
        if sizes.any():
            kept.append(across[:, of_joint] * sizes)
    return np.hstack(kept) if kept else none


def _weights(x: Array, statistics: Statistics) -> Array:
    """Weights of the joints in statistics of rows x (N, n, p), by the lengths of the columns."""
    lengths = np.sum(statistics.factor**2, axis=0)
    used = lengths > 0
    share = np.sum(x**2, axis=0).T[used] / lengths[used, None]
    return np.maximum(posterior_of(share, np.ones(len(share))).mean, 0.0)


def _sizes(gram: Array, z: Array, density: float) -> Array:
    """λ of every shape by the largest marginal likelihood; 0 where it is not significant."""
    unit = density / max(float(np.mean(np.diag(gram))), 1e-300)
    power, axes = np.linalg.eigh(gram)
    is_known = power > 1e-9 * max(float(power[-1]), 1e-300)
    power, axes = power[is_known], axes[:, is_known]
    along = axes.T @ z
    # Variance of Vᵀ z, z = G s + e, in the axes V of G: S P + P Vᵀ Λ V P.
    kinds = [axes[k == KINDS] * power for k in (0, 1)]
    parts = [each.T @ each for each in kinds]
    first, second = (each.ravel() for each in np.meshgrid(SCALES * unit, SCALES * unit))
    variance = first[:, None, None] * parts[0] + second[:, None, None] * parts[1]
    variance += density * np.diag(power)
    misfit = np.linalg.solve(variance, np.broadcast_to(along[:, None], (len(first), len(along), 1)))
    likelihood = -misfit[..., 0] @ along - np.linalg.slogdet(variance)[1]
    best = int(np.argmax(likelihood))
    if not likelihood[best] - likelihood[0] > SIGNIFICANT:
        return np.zeros(SHAPES)
    return np.sqrt(np.array([first[best], second[best]]))[KINDS]
