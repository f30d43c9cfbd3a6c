"""Causes of what a fit leaves, compared by how much each explains.

    r = H_c a_c + N s + e,     T_c = max over a_c of 2 log p(z | a_c) − 2 log p(z | 0),   z = Qᵀ r

H are the columns of every cause beside β and φ, Q is orthonormal, and z has the covariance

    V = V_e + Qᵀ N Λ Nᵀ Q + U

of noise and scatter of blocks V_e (`model_error`), of nuisance shapes N and of usual errors U of
gains; beside all but a delay, of a delay too small to be named. The columns of the causes, each
relative to what the fit or the model π predicts:

    gain of one joint      τ̂_j                    offset of one joint    1
    late torque            −d/dt τ̂                encoder zero           −∂τ/∂q_j (π)
    tilt of the base       −A_d(q) π across gravity, A_d = ∂/∂q [e_d · (R_k, p_k)]

The common factor of all gains is not identifiable and drops out. Rows of momenta or power have no
columns of poses.

All rows are slow parts (`coloured_noise`), and a log that is too short for them hides every cause.
Source: Breusch & Pagan 1980 for score tests, Cameron & Miller 2015 for blocks.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from runtime.estimators.regression import coloured_noise, model_error
from runtime.estimators.regression.posterior import APART, ROUNDING, posterior_of
from runtime.estimators.regression.samples import NORMAL_95, Samples
from runtime.library import Array, Library
from runtime.library.parameters import first_moment, links, mass

GAIN, DELAY, ZERO, TILT, OFFSET = "gain", "delay", "zero", "tilt", "offset"
SIGNIFICANCE = 1e-4
"""Probability of an alarm where the columns are absent or a prior is right. The noise S is known to
some 15 %, which moves T by as much; one in 10 000 leaves room for that within three alarms of a
hundred logs."""
USABLE = {GAIN: 0.03, DELAY: 0.03}
"""Share of the torque that a cause makes, up to which a model predicts torques though its
parameters took up a part of it: 3 % at the joint that carries the arm, 11 % at a wrist, 10 ms."""
POSES = 0.10
"""The same of encoder zeros, tilts and offsets: the log of a KUKA LWR 4+ has residuals of a tilt of
2°, 3.5 % of the torque."""
LEAST_S = 0.5e-3
"""Delay [s] below which its bias is within the intervals: at 3 ms, 14 % of those of the worst
parameter hold, and the bias is proportional to the delay."""
USUAL_GAIN = 0.003  # usual error of a torque gain: sessions of one arm differ by as much
SCALE = 3.0  # factor beyond which, or below its inverse, a gain is not that of a torque constant
LARGEST = {ZERO: np.pi / 2, TILT: np.pi}  # [rad], from which the derivative at 0 fails
NOTICED = 1.645
"""95 % quantile of the normal distribution: an error so many σ above the threshold is seen in 95 of
100 logs."""
GROWTH = 1.4
"""Factor by which an error at the limit raises its own σ, measured 1.2 to 1.42: the weights follow
the residuals, which contain a part of it."""
ALIKE = 4.0  # T below that of the best cause up to which another one is named beside it
_STEP = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """One cause, with its most probable size."""

    kind: str
    joint: int  # index; −1 where it is of all
    size: float  # relative, s, rad or m, rad, N·m
    sigma: float
    share: float  # RMS of the torque that it makes over that of the whole torque, in N·m and N
    statistic: float  # T
    threshold: float  # value that T seldom exceeds where the cause is absent
    vector: Array = field(default_factory=lambda: np.zeros(3))  # change of gravity [m/s²] by a tilt
    # whether size and σ are those of a fit with the cause. A delay is none of the columns beside
    # which friction, whose stroke looks like a delay, takes up a part of it
    is_measured: bool = True

    @property
    def is_significant(self) -> bool:
        """Whether it explains more than noise and nuisance torque do by chance."""
        least = LEAST_S if self.kind == DELAY else 0.0
        return self.statistic > self.threshold and abs(self.size) > least

    @property
    def is_usable(self) -> bool:
        """Whether a result with this cause predicts torques, though its intervals do not hold."""
        return self.share <= USABLE.get(self.kind, POSES)

    @property
    def is_plausible(self) -> bool:
        """Whether a gain may be that of a torque constant, and an angle that of a mount."""
        if self.kind == GAIN:
            return 1 / SCALE < 1 + self.size < SCALE
        return abs(self.size) < LARGEST.get(self.kind, np.inf)

    @property
    def limit(self) -> float:
        """Size that 95 of 100 such logs show; infinite where β and φ take up all of it."""
        return GROWTH * (float(np.sqrt(self.threshold)) + NOTICED) * self.sigma


@dataclass(frozen=True, slots=True)
class Causes:
    """All causes, that which explains most first."""

    ranked: tuple[Cause, ...] = ()

    @property
    def named(self) -> tuple[Cause, ...]:
        """The best significant cause, and those that explain nearly as much; often empty."""
        best = [each for each in self.ranked if each.is_significant][:1]
        return tuple(c for b in best for c in self.ranked if c.statistic > b.statistic - ALIKE)

    def with_delay(self, size: float, sigma: float) -> "Causes":
        """The causes with a delay by its profile [s].

        A delay that is 0 by the profile, and not what its column has, is another misfit.
        """

        def by_profile(cause: Cause) -> Cause:
            if cause.kind != DELAY or not cause.size:
                return cause
            near = NORMAL_95 * sigma
            if abs(size) > near:
                share = cause.share * abs(size / cause.size)
                return replace(cause, size=size, sigma=sigma, share=share, is_measured=True)
            return cause if abs(size - cause.size) < near else replace(cause, statistic=0.0)

        return Causes(_ranked(map(by_profile, self.ranked)))

    def limits(self, kind: str) -> Array:
        """Sizes of one kind that such a log shows, joint after joint."""
        those = sorted((c for c in self.ranked if c.kind == kind), key=lambda c: c.joint)
        return np.array([each.limit for each in those])


def causes_of_rows(lib: Library, samples: Samples, weights: Array, pi: Array) -> Causes:
    """Compare the causes of what base parameters and friction leave of samples of weights (n,)."""
    fit = model_error.free_fit(lib, samples, weights)
    return Causes() if fit is None else causes_of(lib, fit, pi)


def causes_of(lib: Library, fit: model_error.FreeFit, pi: Array) -> Causes:
    """Compare the causes of what a fit leaves."""
    if fit.samples.equations != lib.n_joints:
        return Causes()
    count, n = len(fit.samples), fit.scale.size
    cosines = coloured_noise.slow_cosines(fit.samples)
    fit = fit.slow(cosines)
    kinds, parts = zip(*_columns(lib, fit, pi), strict=True)
    parts = tuple(coloured_noise.slow_part(each, cosines) for each in parts)
    groups = np.repeat(np.arange(len(kinds)), [each.shape[2] for each in parts])
    columns = np.concatenate(parts, axis=2).reshape(count * n, -1)
    if not coloured_noise.tells(n, cosines, fit.basis.shape[1] + columns.shape[1]):
        return Causes(tuple(Cause(kind, j, 0.0, np.inf, 0.0, 0.0, np.inf) for kind, j, _ in kinds))
    lengths = np.linalg.norm(columns, axis=0)
    columns = columns - fit.basis @ (fit.basis.T @ columns)
    # A column that lies in those of β and φ, or a torque of zero, leaves rounding only.
    seen = np.linalg.norm(columns, axis=0) > APART * lengths
    seen &= lengths > ROUNDING * np.linalg.norm(fit.predicted)
    q = columns[:, seen] @ posterior_of(columns[:, seen], rank=APART).root
    if not q.shape[1]:
        return Causes()
    z = q.T @ fit.rest
    rest = fit.rest - q @ z
    shares, unknowns = fit.shares_with(q), fit.basis.shape[1] + q.shape[1]
    density = coloured_noise.coloured_noise_of_shares(
        shares, rest.reshape(count, n), unknowns
    ).density
    if not density > 0:
        return Causes()
    spread = model_error.scatter(fit.samples, q, rest.reshape(count, n), density)
    beside = replace(fit, basis=np.hstack([fit.basis, q]), rest=rest)
    shapes = model_error.nuisance_of(lib, beside, pi, density).scores[fit.basis.shape[1] :]
    usual = np.array([USUAL_GAIN if kinds[k][0] == GAIN else 0.0 for k in groups])
    slight = np.array([LEAST_S if kinds[k][0] == DELAY else 0.0 for k in groups])
    taken = q.T @ columns
    spread += shapes @ shapes.T + (taken * usual) @ (taken * usual).T

    def whitened(covariance: Array) -> tuple[Array, Array]:
        root = np.linalg.cholesky(covariance)
        return np.linalg.solve(root, z), np.linalg.solve(root, taken)

    # A delay that is too small to be named leaves its shape, which is no other cause.
    late, others = map(whitened, (spread, spread + (taken * slight) @ (taken * slight).T))
    ranked, whole = [], np.linalg.norm(fit.predicted.reshape(count, n) / fit.scale)
    for k, (kind, joint, across) in enumerate(kinds):
        chosen = (groups == k) & seen
        threshold = float(chdtri(max(int(chosen.sum()), 1), SIGNIFICANCE))
        if not chosen.any():
            ranked.append(Cause(kind, joint, 0.0, np.inf, 0.0, 0.0, threshold))
            continue
        along, by_cause = late if kind == DELAY else others
        of_cause = posterior_of(by_cause[:, chosen], along)
        explained = float(np.sum((by_cause[:, chosen] @ of_cause.mean) ** 2))
        made = parts[k][..., seen[groups == k]] @ of_cause.mean / fit.scale
        share, vector = float(np.linalg.norm(made) / whole), np.zeros(3)
        size = float(of_cause.mean[0])
        sigma = float(np.nan_to_num(of_cause.sigma, nan=np.inf).max())
        if kind == TILT:
            vector = across[:, seen[groups == k]] @ of_cause.mean
            both = np.array([np.linalg.norm(vector), sigma]) / np.linalg.norm(lib.gravity)
            size, sigma = map(float, both)
        known = size, sigma, share, explained, threshold, vector, kind != DELAY
        ranked.append(Cause(kind, joint, *known))
    return Causes(_ranked(ranked))


def _ranked(causes: Iterable[Cause]) -> tuple[Cause, ...]:
    """The causes, that which explains most beyond chance first."""
    return tuple(sorted(causes, key=lambda each: each.threshold - each.statistic))


def potential_rows(lib: Library, q: Array) -> Array:
    """A, slopes ∂/∂q of the coordinates of the links' frames, (3, N, n, 4 links).

    Gravity torque along g is −Σ_d g_d A_d θ with θ = (m·c, m) of all links.
    """
    n = lib.n_joints
    rows = np.zeros((3, *q.shape, 4 * lib.n_links))
    for i, step in enumerate(_STEP * np.eye(n)):
        slope = (lib.link_poses(q + step) - lib.link_poses(q - step))[:, :, :3] / (2 * _STEP)
        rows[:, :, i] = np.moveaxis(slope, 2, 0).reshape(3, len(q), -1)
    return rows


def _columns(
    lib: Library, fit: model_error.FreeFit, pi: Array
) -> Iterator[tuple[tuple[str, int, Array], Array]]:
    """Kind, joint and axes of every cause, and its weighted columns, (N, n, k)."""
    s, n = fit.samples, fit.scale.size
    predicted, none = fit.predicted.reshape(-1, n), np.zeros((3, 0))
    for j, only in enumerate(np.eye(n)):
        yield (GAIN, j, none), (predicted * only)[..., None]
        yield (OFFSET, j, none), np.broadcast_to(fit.scale * only, predicted.shape)[..., None]
    if (step := coloured_noise.time_step(s)) and len(predicted) > 2:
        rate = np.asarray(np.gradient(predicted, step, axis=0))
        yield (DELAY, -1, none), -rate[..., None]
    if s.acceleration is None:
        return
    for j, move in enumerate(_STEP * np.eye(n)):
        ahead, behind = (lib.inverse_dynamics(s.q + d, s.dq, s.ddq, pi) for d in (move, -move))
        yield (ZERO, j, none), (-fit.scale * (ahead - behind) / (2 * _STEP))[..., None]
    if lib.gravity.any():
        across = np.linalg.svd(lib.gravity[None])[2][1:].T
        bodies = links(pi)
        theta = np.column_stack([first_moment(bodies), mass(bodies)]).ravel()
        turned = np.moveaxis(potential_rows(lib, s.q) @ theta, 0, 2)
        yield (TILT, -1, across), -(turned @ across) * fit.scale[:, None]
