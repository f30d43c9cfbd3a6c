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

Nuisance torque that no column describes: cables, ripple, load, friction that peaks or bends.

    r = X x + N s + e,   s ~ N(0, Λ),   cov e = S

N are shapes of one joint each, with one λ for those of the posture and one for those of friction.
With N' = N − X X⁺ N and G = N'ᵀ N', the scores z = N'ᵀ r of what least squares over X leaves have
the covariance S G + G Λ G. Where X takes up the shapes of a joint, as a cable within a small range
is a mass beside the link, z shows no λ: relative to the torque ranges, λ² of all joints is
exponentially distributed about one square in common, which is 0 or has a prior of its logarithm,
and λ² is its posterior mean. s is integrated out and not exported: the estimate x̂ keeps its value,
and its error gains X⁺ N s with s | r ~ N(s̄, C_s), C_s⁻¹ = G/S + Λ⁻¹, s̄ = C_s z / S.
Source: Kennedy & O'Hagan 2001 for the discrepancy of a model; empirical Bayes for its size.
"""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from scipy.linalg import block_diag
from scipy.special import softmax

from runtime.estimators.regression.coloured_noise import (
    coloured_noise_of_shares,
    shares_of_basis,
    slow_part,
    time_step,
)
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.posterior import APART, ROUNDING, least_squares, posterior_of
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library
from runtime.recording.friction.columns import dahl_state
from runtime.recording.settings import DAHL_STROKE, STRIBECK_SPEED

ROWS = 1500  # samples that determine a gain to a percent or better
EQUATIONS = 14_000  # equations above which robots of over nine joints take fewer samples


@dataclass(frozen=True, slots=True, eq=False)
class FreeFit:
    """Least squares of base parameters and friction without a prior, on evenly spread samples."""

    samples: Samples  # the N samples
    scale: Array  # √w_j that the rows are multiplied by, (n,); of every row (N, n)
    root: Array  # R, which makes the weighted rows X an orthonormal basis Q = X R, (n_b + n k, p)
    basis: Array  # Q of the weighted columns, (N n, p)
    predicted: Array  # weighted torque of the fit, (N n,)
    rest: Array  # weighted residual, (N n,)
    shares: tuple[Array, ...]  # of every frequency that the basis takes up, by `shares_of_basis`

    def slow(self, cosines: int) -> "FreeFit":
        """The fit of the slow part of the rows, the first cosines of time."""
        shape, width = (len(self.samples), self.scale.size), self.basis.shape[1]
        rows = np.column_stack([self.basis, self.predicted + self.rest])
        rows = slow_part(rows.reshape(*shape, -1), cosines).reshape(rows.shape)
        root = posterior_of(rows[:, :-1], rank=APART, lengths=np.ones(width)).root
        basis, target = rows[:, :-1] @ root, rows[:, -1]
        predicted = basis @ (basis.T @ target)
        shares = shares_of_basis(basis.reshape(*shape, -1))
        return FreeFit(
            self.samples, self.scale, self.root @ root, basis, predicted, target - predicted, shares
        )

    def shares_with(self, directions: Array) -> tuple[Array, ...]:
        """Shares beside further orthonormal columns, (N n, k), orthogonal to the basis."""
        added = shares_of_basis(directions.reshape(len(self.samples), self.scale.size, -1))
        return tuple(a + b for a, b in zip(self.shares, added, strict=True))


def free_fit(lib: Library, samples: Samples, weights: Array) -> FreeFit | None:
    """Fit base parameters and friction to about `ROWS` evenly spread samples of weights (n,)."""
    if samples.equations < lib.n_joints:
        return None
    # Evenly spread rows: S is estimated from their residuals, correlated or not.
    count = len(samples)
    step = max(1, count // ROWS, count * lib.n_joints // EQUATIONS)
    s = samples.rows(slice(None, None, step))
    scale = np.sqrt(weights)
    rows = s.rows_of_unknowns(lib) * scale[:, None]
    target = (s.tau * scale).ravel()
    root = posterior_of(rows, rank=APART).root
    basis = rows.reshape(target.size, -1) @ root
    predicted = basis @ (basis.T @ target)
    rest = target - predicted
    if np.linalg.norm(rest) <= APART * np.linalg.norm(target):
        return None
    shares = shares_of_basis(basis.reshape(len(s), scale.size, -1))
    return FreeFit(s, scale, root, basis, predicted, rest, shares)


SLOW = 0.06  # speed at which friction that grows with load has nearly its whole size [rad/s, m/s]
POSTURE, FRICTION, OF_POSITION = range(3)
KINDS = np.repeat([POSTURE, OF_POSITION, FRICTION], [5, 4, 4])
"""Kind of every shape, each with its λ: of the posture (q, sin q, cos q, sin 2q, cos 2q), friction
that depends on the position (ζ sin q, ζ cos q, dq sin q, dq cos q), other friction (load, bend over
the speed, peak at low speed, stroke of the memory)."""
USUAL_SIZE, DOUBT = 0.003, 1.0  # expected common λ over the joint's range, and σ of ln λ
RARE = 100.0
"""Odds against friction that depends on the position. A change of the friction by 5 % over a turn
outweighs odds of 1000 within 30 s on another simulator; even odds make intervals of springs in an
exact model 1.4 times too wide."""
MOST, STEP = 0.02, 1.6
"""Largest λ over the range of the joint, and ratio of candidates: q hardly differs from sin q where
a joint moves little, and would leave both of them open."""
SIZES = np.concatenate([[0.0], MOST * STEP ** -np.arange(12.0)[::-1]])  # λ over the joint's range
SHAPES = len(KINDS)  # number of shapes
PLACEHOLDER = 100.0
"""Limits of effort over the largest torques of a log from which on, at every joint, they are none
of this robot: a URDF has 2000 N·m at a small arm. A wrist alone may hardly be used."""
QUANTILES = 400  # candidates of a common λ²: the smallest is a thousandth of the expected one


def nuisance_columns(
    lib: Library, pi: Array, samples: Samples, stroke: Array | float = DAHL_STROKE
) -> Array:
    """Shapes N of the joints, of size 1, (N, n, shapes): each has rows of its joint alone.

    A peak at low speed is over the Dahl state ζ of the path, since reversals within the presliding
    stroke have none. The viscous coefficient of friction that bends is the slope of its best
    line over ζ, dq and 1: the root of the speed is what that line leaves of it. The whole root is
    nearly the same at low speeds, and would take a peak there for a bend at every speed. Friction
    has a memory, whatever the columns contain, and its stroke may be half or twice the usual one,
    which looks like a delay.
    """
    q, dq = samples.q, samples.dq
    still = np.zeros_like(q)
    load = np.abs(lib.inverse_dynamics(q, still, still, pi))
    zeta, root = dahl_state(q, stroke), np.sign(dq) * np.sqrt(np.abs(dq))
    for j in range(q.shape[1]):
        line = np.column_stack([zeta[:, j], dq[:, j], np.ones(len(q))])
        root[:, j] = least_squares(line, root[:, j])[1]
    each = [q, np.sin(q), np.cos(q), np.sin(2 * q), np.cos(2 * q)]
    each += [zeta * np.sin(q), zeta * np.cos(q), dq * np.sin(q), dq * np.cos(q)]
    each += [load / np.maximum(load.max(axis=0), 1e-12) * np.tanh(dq / SLOW), root]
    each += [zeta * np.exp(-((dq / STRIBECK_SPEED) ** 2))]
    each += [dahl_state(q, stroke / 2) - dahl_state(q, 2 * stroke)]
    return np.stack(each, axis=2)


def torque_ranges(lib: Library, tau: Array) -> Array:
    """Largest torque of every joint, by the model, else of rows (N, n), (n,).

    A limit below the rows' largest torque is a placeholder of the URDF, and so are all where every
    one is far above it.
    """
    effort = np.asarray(lib.limits()["effort"], float)
    largest = np.maximum(np.abs(tau).max(axis=0), 1e-9)
    known = np.isfinite(effort) & (effort >= largest)
    if known.any() and (effort[known] > PLACEHOLDER * largest[known]).all():
        return largest
    return np.where(known, effort, largest)


@dataclass(frozen=True, slots=True, eq=False)
class NuisanceTorque:
    """Nuisance torque of a free fit."""

    scores: Array  # Qᵀ N λ, in the basis Q of the fit, (p, m)
    error: Array  # Qᵀ N [C_s^½, s̄] of s | r ~ N(s̄, C_s), error of the fit, (p, m + joints)
    moved: Array  # Qᵀ N s̄, (p,)
    mean: Array  # most probable torque beside the columns of the fit, weighted, (N, n)


def nuisance_of(
    lib: Library,
    fit: FreeFit,
    pi: Array,
    density: float,
    with_position: bool = True,
    stroke: Array | float = DAHL_STROKE,
) -> NuisanceTorque:
    """Nuisance torque that the residual of a fit makes likely.

    with_position: also friction that depends on the position; stroke z_c of the fit [rad, m].
    """
    samples, n = fit.samples, fit.scale.shape[-1]
    rest = fit.rest.reshape(len(samples), n)
    mean, kept = np.zeros_like(rest), [np.zeros((fit.basis.shape[1], 0))]
    errors = list(kept)
    if samples.base is not None or samples.equations != lib.n_joints:
        return NuisanceTorque(kept[0], kept[0], np.zeros(len(kept[0])), mean)
    columns = nuisance_columns(lib, pi, samples, stroke) * (with_position | (KINDS != OF_POSITION))
    shapes = np.moveaxis(columns * fit.scale[..., None], 1, 0)
    basis = np.moveaxis(fit.basis.reshape(len(samples), n, -1), 1, 0)
    taken, by_row = basis.swapaxes(1, 2) @ shapes, shapes.swapaxes(1, 2)
    grams = by_row @ shapes - taken.swapaxes(1, 2) @ taken
    scores = (by_row @ rest.T[..., None])[..., 0]
    sizes = nuisance_sizes(grams, scores, density, torque_ranges(lib, samples.tau))
    for j in range(n):
        kept.append(taken[j] * sizes[j])
        root, s = size_posterior(grams[j], scores[j], density, sizes[j])
        errors.append(taken[j] @ np.column_stack([root, s]))
        mean[:, j] += shapes[j] @ s
        mean -= (basis @ (taken[j] @ s)).T
    moved = np.sum([each[:, -1] for each in errors[1:]], axis=0)
    return NuisanceTorque(np.hstack(kept), np.hstack(errors), moved, mean)


def with_model_error(lib: Library, fit: FreeFit, pi: Array, density: float, root: Array) -> Array:
    """Root of the covariance of the unknowns of a fit with scatter of blocks and nuisance torque.

    root of that by noise alone (p, r) → (p, m).
    """
    torque = nuisance_of(lib, fit, pi, density)
    rest = fit.rest.reshape(torque.mean.shape) - torque.mean
    sizes, axes = np.linalg.eigh(scatter(fit.samples, fit.basis, rest, density))
    wider = axes * np.sqrt(np.maximum(sizes / density, 1.0))
    return np.hstack([root @ wider, fit.root @ torque.error])


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


def nuisance_sizes(grams: Array, scores: Array, density: float, ranges: Array) -> Array:
    """√E[λ² | z] of the shapes of all joints, (n, m) [N·m, N]; `OF_POSITION` beside the others.

    Gram matrices (n, m, m), scores (n, m), ranges (n,) [N·m, N] of the joints.
    """
    # Probabilities of the sizes i, j for every size in common a, b of the joints n, (a, i).
    edges = np.concatenate([[0.0], np.sqrt(SIZES[1:-1] * SIZES[2:]), [np.inf]])
    edges = np.insert(edges, 1, SIZES[1] / np.sqrt(STEP))
    law = np.diff(-np.exp(-((edges / SIZES[1:, None]) ** 2)), axis=1)
    law = np.vstack([np.eye(1, len(SIZES)), law])  # a robot without nuisance torque has λ = 0
    squares, known = law * SIZES**2, np.zeros(scores.shape)
    usual = np.exp(-0.5 * (np.log(SIZES[1:] / USUAL_SIZE) / DOUBT) ** 2)
    pair, alone = (POSTURE, FRICTION), (OF_POSITION,)
    for kinds, odds, sums in ((pair, 1.0, "nij,ai,bj->nab"), (alone, RARE, "ni,ai->na")):
        joints = zip(grams, scores, known, ranges, strict=True)
        each = np.array([_likelihoods(*joint, density, kinds) for joint in joints])
        evidence = np.maximum(np.einsum(sums, each, *[law] * len(kinds)), np.finfo(float).tiny)
        prior = reduce(np.add.outer, [np.log(np.append(odds * usual.sum(), usual))] * len(kinds))
        shares = softmax(prior + np.log(evidence).sum(axis=0)) / evidence
        for kind in kinds:
            laws = [squares if other == kind else law for other in kinds]
            mean = (shares * np.einsum(sums, each, *laws)).reshape(len(each), -1)
            known += mean.sum(axis=1)[:, None] * (kind == KINDS)
    return np.asarray(np.sqrt(known) * ranges[:, None])


def _likelihoods(
    gram: Array, z: Array, known: Array, most: float, density: float, kinds: tuple[int, ...]
) -> Array:
    """p(z) over its largest value, of the sizes of some kinds, (k, …), beside λ²/most² known."""
    power, axes = np.linalg.eigh(gram)
    sizes = SIZES * most
    # Data that are exact to rounding leave a variance that is not singular.
    density = max(density, ROUNDING * float(sizes[-1] ** 2 * power[-1]))
    is_known = power > 1e-9 * max(float(power[-1]), 1e-300)
    power, axes = power[is_known], axes[:, is_known]
    along = axes.T @ z
    # Variance of Vᵀ z, z = G s + e, in the axes V of G: S P + P Vᵀ Λ V P.
    parts = axes * power
    variance = density * np.diag(power) + most**2 * (parts.T * known) @ parts
    for kind in kinds:
        of_kind = parts[kind == KINDS]
        variance = variance[..., None, :, :] + np.multiply.outer(sizes**2, of_kind.T @ of_kind)
    right = np.broadcast_to(along[:, None], (*variance.shape[:-1], 1))
    misfit = np.linalg.solve(variance, right)[..., 0] @ along + np.linalg.slogdet(variance)[1]
    return np.asarray(np.exp((misfit.min() - misfit) / 2))


BLOCK_S, FEWEST, PER_COLUMN = 2.0, 3, 5
"""Length of a block, of which 1 and 5 s give the same σ to 15 % on an industrial arm [s]; number of
blocks from which on their scatter counts, and per column for directions of their own."""
LEAST = 0.25  # least variance of a direction over the noise: fewer rows turn its axes


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
        gains, gain_sigma = change_error(taken, predicted[..., None], rest, level, gain_sigma)
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


def change_error(
    taken: Array, torque: Array, rest: Array, level: float, expected: float
) -> tuple[Array, float]:
    """Errors Qᵀ N [C_s^½, s̄] of changes such as gains, (p, n m + 1), and their σ by the residual.

    taken (p, n m) Qᵀ N, torque N (N, n, m) of the joints' own changes, and residuals (N, n) of
    variance level over their weights.
    """
    gram = block_diag(*np.einsum("ijk,ijl->jkl", torque, torque)) - taken.T @ taken
    z = np.einsum("ijk,ij->jk", torque, rest).ravel()
    sigma = common_size(gram, z, level, expected)
    root, mean = size_posterior(gram, z, level, np.full(len(z), sigma))
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
