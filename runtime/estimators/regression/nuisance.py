"""Nuisance torque that no column describes: cables, ripple, load, friction that peaks or bends.

    r = X x + N s + e,   s ~ N(0, Λ),   cov e = S

N are shapes of one joint each, with one λ for those of the posture and one for those of friction.
They maximise the marginal likelihood of what least squares over X leaves: with N' = N − X X⁺ N and
G = N'ᵀ N', the scores z = N'ᵀ r have the covariance S G + G Λ G. s is integrated out and not
exported: the estimate x̂ keeps its value, and its error gains X⁺ N s with s | r ~ N(s̄, C_s),
C_s⁻¹ = G/S + Λ⁻¹, s̄ = C_s z / S.
Source: Kennedy & O'Hagan 2001 for the discrepancy of a model; empirical Bayes for its size.
"""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.regression.omitted_columns import FreeFit
from runtime.estimators.regression.posterior import ROUNDING, least_squares
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library
from runtime.recording.friction.columns import dahl_state
from runtime.recording.settings import DAHL_STROKE, STRIBECK_SPEED

SLOW = 0.06
"""Speed at which friction that grows with the load has nearly its whole size [rad/s, m/s]."""
KINDS = np.array([0, 0, 0, 0, 0, 1, 1, 1])
"""Kind of every shape, each with its λ: 0 of the posture (q, sin q, cos q, sin 2q, cos 2q), 1 of
friction (load, bend over the speed, peak at low speed)."""
MOST = 0.02
"""Largest λ over the range of the joint: q hardly differs from sin q where a joint moves little,
and would leave both of them open."""
SHAPES = len(KINDS)
SIGNIFICANT = 4.6
"""Gain of 2 log p from which on a joint has nuisance torque: 5 % of logs that have none."""
QUANTILES = 400
"""Number of candidates of a common λ²: the smallest is a thousandth of the expected one."""
SCALES = np.concatenate([[0.0], np.logspace(-6, 4, 31)])
"""Candidates of λ² over the variance with which the noise enters a shape."""


def nuisance_columns(lib: Library, pi: Array, samples: Samples) -> Array:
    """Shapes N of the joints, of size 1, (N, n, SHAPES): each has rows of its joint alone.

    A peak at low speed is over the Dahl state ζ of the path, since reversals within the presliding
    stroke have none. The viscous coefficient of friction that bends is the slope of its best
    line over ζ, dq and 1: the root of the speed is what that line leaves of it. The whole root is
    nearly the same at low speeds, and would take a peak there for a bend at every speed.
    """
    q, dq = samples.q, samples.dq
    still = np.zeros_like(q)
    load = np.abs(lib.inverse_dynamics(q, still, still, pi))
    zeta, root = dahl_state(q, DAHL_STROKE), np.sign(dq) * np.sqrt(np.abs(dq))
    for j in range(q.shape[1]):
        line = np.column_stack([zeta[:, j], dq[:, j], np.ones(len(q))])
        root[:, j] = least_squares(line, root[:, j])[1]
    each = [q, np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)]
    each += [load / np.maximum(load.max(axis=0), 1e-12) * np.tanh(dq / SLOW), root]
    return np.stack([*each, zeta * np.exp(-((dq / STRIBECK_SPEED) ** 2))], axis=2)


def torque_ranges(lib: Library, tau: Array) -> Array:
    """Largest torque of every joint, by the model, else of rows (N, n), (n,)."""
    effort = np.asarray(lib.limits()["effort"], float)
    largest = np.maximum(np.abs(tau).max(axis=0), 1e-9)
    return np.where(np.isfinite(effort) & (effort > 0), effort, largest)


@dataclass(frozen=True, slots=True, eq=False)
class NuisanceTorque:
    """Nuisance torque of a free fit."""

    scores: Array  # Qᵀ N λ, in the basis Q of the fit, (p, m); no column without nuisance torque
    # Qᵀ N [C_s^½, s̄] of s | r ~ N(s̄, C_s), which the error of the fit has, (p, m + joints)
    error: Array
    mean: Array  # most probable torque beside the columns of the fit, weighted, (N, n)


def nuisance_of(lib: Library, fit: FreeFit, pi: Array, density: float) -> NuisanceTorque:
    """Nuisance torque that the residual of a fit makes likely."""
    samples, n = fit.samples, fit.scale.size
    rest = fit.rest.reshape(len(samples), n)
    mean, kept = np.zeros_like(rest), [np.zeros((fit.basis.shape[1], 0))]
    errors = list(kept)
    if samples.base is not None or samples.equations != lib.n_joints:
        return NuisanceTorque(kept[0], kept[0], mean)
    shapes = nuisance_columns(lib, pi, samples) * fit.scale[:, None]
    ranges = torque_ranges(lib, samples.tau)
    basis = fit.basis.reshape(len(samples), n, -1)
    for j in range(n):
        taken, inner = basis[:, j].T @ shapes[:, j], shapes[:, j].T @ shapes[:, j]
        gram, z = inner - taken.T @ taken, shapes[:, j].T @ rest[:, j]
        sizes = likely_sizes(gram, z, density, float(np.trace(inner)))
        sizes = np.minimum(sizes, MOST * ranges[j])
        if sizes.any():
            kept.append(taken * sizes)
            root, s = size_posterior(gram, z, density, sizes)
            errors.append(taken @ np.column_stack([root, s]))
            mean[:, j] += shapes[:, j] @ s
            mean -= np.einsum("ijk,k->ij", basis, taken @ s)
    return NuisanceTorque(np.hstack(kept), np.hstack(errors), mean)


def size_posterior(gram: Array, z: Array, density: float, sizes: Array) -> tuple[Array, Array]:
    """C_s^½ and s̄ of s | r ~ N(s̄, C_s): C_s⁻¹ = G/S + Λ⁻¹, s̄ = C_s z/S, λ of `sizes` (m,)."""
    power, axes = np.linalg.eigh(sizes[:, None] * gram * sizes / density + np.eye(len(sizes)))
    root = sizes[:, None] * axes / np.sqrt(np.maximum(power, 1.0))
    return root, root @ (root.T @ z) / density


def common_size(gram: Array, z: Array, density: float, expected: float) -> float:
    """√E[λ² | z] of shapes of one λ, at most `expected`; λ² is exponential about its square before.

    Scores z ~ N(0, S G + λ² G²); without information the size is the expected one.
    """
    power, axes = np.linalg.eigh(gram)
    is_known = power > ROUNDING * max(float(power[-1]), 1e-300)
    ratio, along = power[is_known] / density, axes[:, is_known].T @ z
    # Midpoints of equal probability, of mean 1.
    squares = -np.log1p(-(np.arange(QUANTILES) + 0.5) / QUANTILES)
    squares /= squares.mean()
    variance = 1 + expected**2 * squares[:, None] * ratio
    misfit = np.sum(along**2 / (density * power[is_known]) / variance + np.log(variance), axis=1)
    weights = np.exp((misfit.min() - misfit) / 2)
    return float(expected * np.sqrt(min(weights @ squares / weights.sum(), 1.0)))


def likely_sizes(gram: Array, z: Array, density: float, whole: float) -> Array:
    """λ of every shape by the largest marginal likelihood; 0 where it is not significant.

    whole: trace of NᵀN; shapes of which the fit leaves rounding alone have no λ.
    """
    if not np.trace(gram) > ROUNDING * whole:
        return np.zeros(SHAPES)
    unit = density / max(float(np.mean(np.diag(gram))), 1e-300)
    power, axes = np.linalg.eigh(gram)
    is_known = power > 1e-9 * max(float(power[-1]), 1e-300)
    power, axes = power[is_known], axes[:, is_known]
    along = axes.T @ z
    # Variance of Vᵀ z, z = G s + e, in the axes V of G: S P + P Vᵀ Λ V P.
    kinds = [axes[k == KINDS] * power for k in (0, 1)]
    parts = [each.T @ each for each in kinds]

    def likelihood(first: Array, second: Array) -> Array:
        """−2 log p but for a constant, its sign changed, at pairs of places in SCALES."""
        one, two = unit * SCALES[first], unit * SCALES[second]
        variance = one[:, None, None] * parts[0] + two[:, None, None] * parts[1]
        variance += density * np.diag(power)
        right = np.broadcast_to(along[:, None], (len(one), len(along), 1))
        misfit = np.linalg.solve(variance, right)[..., 0]
        return np.asarray(-misfit @ along - np.linalg.slogdet(variance)[1])

    best, values, places = (0, 0), np.zeros(0), np.concatenate([[0], np.arange(1, len(SCALES), 3)])
    around = [places, places]
    for _ in range(2):  # every third place, then all beside the best
        first, second = (each.ravel() for each in np.meshgrid(*around))
        seen = likelihood(first, second)
        values = np.append(values, seen)
        if seen.max() >= values.max():
            best = int(first[np.argmax(seen)]), int(second[np.argmax(seen)])
        last = len(SCALES) - 1
        around = [np.arange(max(k - 2, 0), min(k + 2, last) + 1) for k in best]
    if not values.max() - values[0] > SIGNIFICANT:
        return np.zeros(SHAPES)
    return np.sqrt(unit * SCALES[list(best)])[KINDS]
