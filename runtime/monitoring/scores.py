"""Scores of a log over all changes that are distinguished, and their covariance on a healthy robot.

For log i with residual r_i over its noise and the slow parts H_i of the columns of all changes
(`coloured_noise`), Q_i orthonormal,

    z_i = Q_iᵀ r_i = Q_iᵀ [H_i (u + d_i) + X_i L ε + N_i s] + e_i
    u, d_i ~ N(0, T²),   ε ~ N(0, a²),   e_i ~ N(0, V_i)

e is noise and misfit of the model within the log: V = (1 − ρ) c D + ρ Σ_k g_k g_kᵀ K/(K−1) with
scores g_k of K blocks, c their mean variance, D of trace r as the densities of the joints, and ρ ≤
½; what the misfit adds in the postures of one log, in the directions of L; a constant torque of
every joint that rests, within its dry friction; and F exp(−travel / z_c) of friction with a memory,
whose first state is unknown. Where a motion returns after a period, misfit does so as well: blocks
are those of one period, and c is at least R S̄, with S̄ the density of the mean residual of R
repetitions. d is the usual change of a healthy robot between two days, u that of the day of the
model, and L a root of the posterior of the model. Torque of further shapes, N s with a prior of s,
is a nuisance: cables, ripple, load. u, ε and s are common to all logs: logs of reference give their
posterior, and all scales by the marginal likelihood.
Source: block-robust covariance (Cameron & Miller 2015), random effects per log (Laird & Ware 1982).
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from runtime.errors import IdentificationError
from runtime.estimators.regression import coloured_noise, model_error
from runtime.estimators.regression.posterior import APART, posterior_of
from runtime.estimators.regression.recorded_delay import NEAR_S
from runtime.estimators.regression.samples import Samples, sums_of_groups
from runtime.identification.identified import torque_of
from runtime.library import Array, Library
from runtime.library.manifest import torque_units
from runtime.monitoring.model import MonitoredModel
from runtime.recording.preprocessing.segments import rate_of
from runtime.recording.rest_speeds import rest_speeds
from runtime.recording.settings import COLUMNS

ROBUST = 0.5
"""Largest share of the scatter between blocks in V; the rest is their mean, which few blocks
determine, and the whole of it with less than `FEWEST` blocks."""
USUAL = {
    "clock": 0.0007,
    "sensor gain": 0.005,
    "sensor bias": 0.003,
    "friction": 0.10,
    "sensor drift": 0.001,
    "warming": 0.05,
    "model": 1.0,
    "posture": 0.5,
    "shape": model_error.USUAL_SIZE,
}
"""Usual change of a robot between two days, without logs of reference: s; relative; relative to the
range of the joint; relative, √2 times `LARGE_DAY` of friction. Usual change of bias and friction
during a log. Errors of the model, and what its misfit adds in the postures of one log, in σ of its
posterior; torque of other shapes, relative to the range of the joint."""
PLAUSIBLE = {
    "clock": 0.1,
    "sensor gain": 1.0,
    "sensor bias": 1.0,
    "friction": 3.0,
    "sensor drift": 1.0,
    "warming": 1.0,
}
"""Sizes of changes that a robot may have, in the units of `USUAL`. A direction of changes in which
such a size is within the noise is not determined by a log and explains nothing."""
AWAY, RETURNED = 0.3, 0.02
"""Mean squared distance of a motion from itself some time later, over that of unrelated postures,
above which it has gone elsewhere and below which it has returned."""
STILL = 0.02  # travel of a joint over the largest one below which it hardly counts
REST_S = 0.2  # shortest time at rest after which dry friction is another one [s]
DRY = 0.02  # dry friction that the model does not contain, relative to the range of the joint
DOUBT = 1.0  # standard deviation of the logarithm of a scale about its default
FARTHEST = 5.0
"""Largest usual change that references may show, in DOUBT of its default: 150 times as much. Where
that leaves their scores at as many σ (RMS), a search ends where rounding takes it."""
FREEDOM, ASSUMED = 3, 20
"""Degrees of freedom of the covariance that a log of reference adds, or assumed changes; a log that
is tested adds K − 1."""
FULL_MISFIT = 2.0
"""c − 1 from which on the defaults count in full. A robot whose scores have the variance of white
residuals is simulated: what moves between days leaves a misfit within a log, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Columns of all changes of a model; those of the base parameters follow the named ones."""

    names: tuple[tuple[str, str], ...]  # kind and joint of every named column, (K,)
    units: Array  # size to which the usual change is relative, (K,)
    shown: tuple[tuple[str, float], ...]  # unit of a stated size, and its factor, (K,)
    ranges: Array  # of the joints, (n,) [N·m, N]

    def usual(self, scales: Array) -> Array:
        """T, usual change of every named column, (K,)."""
        kinds = list(USUAL)
        return np.array([scales[kinds.index(kind)] for kind, _ in self.names]) * self.units

    def of(self, kind: str, joint: str | None = None) -> NDArray[np.int64]:
        """Numbers of the columns of a kind, of all joints or of one."""
        are = [name[0] == kind and joint in (None, name[1]) for name in self.names]
        return np.flatnonzero(are)


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """Scores of one log in an orthonormal basis Q of its columns."""

    z: Array  # Qᵀ r, (r,)
    columns: Array  # Qᵀ H, (r, K + n_b)
    error: Array  # Qᵀ X L, (r, p)
    shape: Array  # Qᵀ N, nuisance columns, (r, SHAPES n)
    noise: Array  # V, (r, r)
    # c over that of white noise behind the same low-pass filter; inf where the band of the motion
    # holds all that passes: noise of any colour may look white there
    misfit: float
    blocks: int  # number of blocks
    n_eff: float  # effective number of samples


@dataclass(frozen=True, slots=True, eq=False)
class Usual:
    """What a healthy robot leaves in a further log."""

    scales: Array  # of `USUAL`, (9,)
    mean: Array  # mean, covariance: of (u, ε)
    covariance: Array
    freedom: float  # degrees of freedom of the covariance
    references: int  # number of logs from which the scales were learnt


def changes_of(lib: Library, model: MonitoredModel, tau: Array) -> Changes:
    """Columns that a model can change by; a joint without a range takes the torque (N, n)."""
    ranges = model_error.torque_ranges(lib, tau)
    rows: list[tuple[tuple[str, str], float, tuple[str, float]]] = []
    rows.append((("clock", ""), 1.0, ("ms", 1e3)))
    for joint, most, unit in zip(lib.joint_names, ranges, torque_units(lib.manifest), strict=True):
        rows.append((("sensor gain", joint), 1.0, ("%", 100.0)))
        rows.append((("sensor bias", joint), float(most), (unit, 1.0)))
        rows.append((("sensor drift", joint), float(most), (unit, 1.0)))
    rows.append((("warming", ""), 1.0, ("%", 100.0)))
    rows += [(("friction", lib.joint_names[j]), 1.0, ("%", 100.0)) for j, _ in _changing(model)]
    names, units, shown = zip(*rows, strict=True)
    return Changes(names, np.array(units), shown, ranges)


def _changing(model: MonitoredModel) -> list[tuple[int, int]]:
    """Joint and number of the friction columns that may change."""
    records = [COLUMNS[name] for name in model.terms.columns]
    free = [not each.is_constant and not each.is_inertial for each in records]
    return [(j, c) for j, c in np.argwhere(model.phi != 0).tolist() if free[c]]


@dataclass(frozen=True, slots=True, eq=False)
class ChangedRows:
    """Equations of a log over all changes, divided by their noise: m per instant."""

    t: Array  # (N,) [s]
    rest: Array  # r, (N, m)
    error: float  # of the model, ‖τ − τ̂‖ over ‖τ‖ [%]
    columns: Array  # of all changes, (N, m, K + n_b)
    known: Array  # X over [β; φ], (N, m, p)
    shapes: Array  # N of a joint's range, (N, m, S)
    cosines: int  # number of cosines of time that the motion has
    low_pass: float  # N / N_eff of white noise behind the low-pass of the log
    # size of a constant torque of one equation in some rows
    holds: tuple[tuple[float, int, slice], ...] = ()
    period: int = 0  # number of rows after which the motion returns; 0 where it does not
    sessions: Array | None = None  # what every log has another size of about 0, σ 1, (N, m, o)

    def tells(self) -> bool:
        """Whether the log is long enough for scores over all changes."""
        return coloured_noise.tells(self.rest.shape[1], self.cosines, self.columns.shape[2])


def changed_rows(
    lib: Library,
    model: MonitoredModel,
    pi: Array,
    t: Array,
    samples: Samples,
    over: Array,
    ranges: Array,
) -> ChangedRows:
    """Equations of a log of joints.

    pi (10 n,), t (N,) [s], over (n,) 1/σ [1/(N·m)], ranges (n,) [N·m, N].
    """
    count, n = samples.tau.shape
    base, tau = samples.base_rows(lib), torque_of(lib, samples, pi, model.phi)
    named = named_columns(t, tau, [samples.friction(phi) for phi in changing_friction(model)])
    still = _at_rest(t, np.abs(samples.dq) < rest_speeds(lib))
    # Dry friction turns round before a joint leaves its rest, which looks like a delay.
    for j, part in still:
        named[(t > t[part][0] - NEAR_S) & (t < t[part][-1] + NEAR_S), j, 0] = 0.0
    columns = np.concatenate([named, base], axis=2) * over[:, None]
    known = np.concatenate([base, samples.friction_rows()], axis=2) * over[:, None]
    dry = np.where(model.dry_friction > 0, model.dry_friction, DRY * ranges) * over
    # Reading noise of q adds up along a path, but hardly in a span.
    span = np.maximum.accumulate(samples.q) - np.minimum.accumulate(samples.q)
    first = model.unknown_state(span) * over
    shapes = np.zeros((count, n, n, model_error.SHAPES))
    joints = np.arange(n)
    shapes[:, joints, joints] = model_error.nuisance_columns(lib, pi, samples) * over[:, None]
    return ChangedRows(
        t,
        (samples.tau - tau) * over,
        error_percent(samples.tau - tau, samples.tau),
        columns,
        known,
        shapes.reshape(count, n, -1),
        coloured_noise.slow_cosines(samples),
        low_pass_inflation(model.preparation.cutoff_hz, t),
        tuple((float(dry[j]), j, part) for j, part in still),
        period_of(samples.q),
        first[:, :, None] * np.eye(n),
    )


def period_of(q: Array) -> int:
    """Number of rows after which a motion q (N, n) returns; 0 where two thirds of it never do."""
    x = q - q.mean(axis=0)
    x /= np.maximum(x.std(axis=0), STILL * max(float(x.std(axis=0).max()), 1e-300))
    whole, lags = 2 * max(float(np.mean(x**2)), 1e-300), range(1, 2 * len(x) // 3)
    distance = np.array([np.mean((x[k:] - x[:-k]) ** 2) for k in lags]) / whole
    gone = np.logical_or.accumulate(distance > AWAY)
    if not (near := np.flatnonzero(gone & (distance < RETURNED))).size:
        return 0
    first = int(near[0])  # of the lags about it, the nearest
    return first + 1 + int(np.argmin(distance[first : first * 11 // 10 + 1]))


def error_percent(rest: Array, tau: Array) -> float:
    """Norm of what a model leaves over that of the torques [%]."""
    return 100 * float(np.linalg.norm(rest)) / max(float(np.linalg.norm(tau)), 1e-300)


def low_pass_inflation(cutoff_hz: float | None, t: Array) -> float:
    """N / N_eff of white noise behind a low-pass."""
    return max(1.0, 0.5 / (cutoff_hz * float(np.median(np.diff(t))))) if cutoff_hz else 1.0


def changing_friction(model: MonitoredModel) -> list[Array]:
    """φ (n, k) of each single coefficient that may change, the others 0."""
    single = []
    for j, c in _changing(model):
        single.append(np.zeros_like(model.phi))
        single[-1][j, c] = model.phi[j, c]
    return single


def named_columns(t: Array, tau: Array, friction: Sequence[Array]) -> Array:
    """Torques (N, n, K) of the named changes: tau (N, n) of the model, (N, n) of its friction."""
    count, n = tau.shape
    elapsed = (t - t[0]) / max(float(t[-1] - t[0]), 1e-12) - 0.5
    named = [-rate_of(t, tau)]
    for values, joint in zip(tau.T, np.eye(n), strict=True):
        named += [each[:, None] * joint for each in (values, np.ones(count), elapsed)]
    named.append(elapsed[:, None] * np.sum([np.zeros((count, n)), *friction], axis=0))
    return np.stack([*named, *friction], axis=2)


def scores_of_rows(rows: ChangedRows, root: Array) -> Scores:
    """Scores of a log, by the root L (p, columns) of the covariance of [β; φ]."""
    t, (count, n) = rows.t, rows.rest.shape
    flat = coloured_noise.slow_part(rows.columns, rows.cosines).reshape(count * n, -1)
    q = flat @ posterior_of(flat, rank=APART).root
    z = q.T @ rows.rest.ravel()
    basis, rest = q.reshape(count, n, -1), rows.rest - (q @ z).reshape(count, n)
    slow = coloured_noise.slow_part(rest, rows.cosines)
    densities = np.maximum(coloured_noise.densities_of_basis(basis, slow), 1e-300)
    scatter = np.einsum("ijk,j,ijl->kl", basis, densities, basis, optimize=True)
    density = of_rows = float(np.trace(scatter)) / len(z)
    block = ((t - t[0]) // model_error.BLOCK_S).astype(int)
    if rows.period:
        # R S̄ of a motion of R repetitions: variance of scores by residuals that return with it.
        phase = np.arange(count) % rows.period
        again = sums_of_groups(basis, phase)
        mean = sums_of_groups(slow, phase) / np.bincount(phase)[:, None]
        returning = coloured_noise.coloured_noise_of_rows(again, mean).density
        density = max(density, float(np.sum(again**2)) / len(z) * returning)
        number = max(model_error.FEWEST, round(block[-1] * rows.period / count))
        block = phase * number // rows.period
    # The variance is that of all rows, fast ones too.
    coloured = coloured_noise.ColouredNoise(
        density, (float(np.sum(rest**2)) + len(z) * density) / rest.size
    )
    g = sums_of_groups(np.einsum("ijk,ij->ik", basis, slow), block)
    g = g[np.bincount(block) > 0]
    meat = g.T @ g * (len(g) / max(len(g) - 1, 1))
    level = max(density, float(np.trace(meat)) / len(z))
    noise = scatter * (level / of_rows)
    robust = _robust_share(g, noise) if len(g) >= model_error.FEWEST else 0.0
    noise += robust * (meat - noise)
    for size, j, part in rows.holds:
        held = basis[part, j].sum(axis=0)
        noise += size**2 * np.outer(held, held)
    if rows.sessions is not None:
        of_session = q.T @ rows.sessions.reshape(count * n, -1)
        noise += of_session @ of_session.T
    is_shown = rows.cosines * rows.low_pass < count
    misfit = level / (rows.low_pass * max(coloured.variance, 1e-300)) if is_shown else np.inf
    error = q.T @ (rows.known.reshape(count * n, -1) @ root)
    n_eff = count / max(coloured.inflation, 1.0)
    shape = q.T @ rows.shapes.reshape(count * n, -1)
    return Scores(z, q.T @ flat, error, shape, noise, misfit, len(g), n_eff)


def _robust_share(g: Array, noise: Array) -> float:
    """Share of the scatter of block scores g (K, r) in V, ρ = ‖Σ − μ1‖² / E‖S − μ1‖².

    S is their covariance over that of the noise of rows (r, r), and Σ what it estimates. Few blocks
    scatter in few directions, also where Σ = μ1, of which S shows nothing: with n = K − 1,

        E tr S² = (1 + 1/n) tr Σ² + tr² Σ/n

    Source: Ledoit & Wolf 2004, for normal scores Chen, Wiesel, Eldar & Hero 2010.
    """
    x = np.asarray(solve_triangular(np.linalg.cholesky(noise), g.T, lower=True))
    gram, n = x.T @ x * (len(g) / (len(g) - 1)), len(g) - 1  # of the blocks: the norms of S
    square, trace = float(np.sum(gram**2)), float(np.trace(gram))
    apart = square - trace**2 / len(x)
    known = n**2 / ((n - 1) * (n + 2)) * (square - trace**2 / n) - trace**2 / len(x)
    return float(np.clip(known / apart, 0.0, ROBUST)) if apart > 0 else 0.0


def _at_rest(t: Array, rests: NDArray[np.bool_]) -> list[tuple[int, slice]]:
    """Joint, and the rows of one time of its rest."""
    parts = []
    for j in range(rests.shape[1]):
        ends = np.flatnonzero(np.diff(rests[:, j], prepend=False, append=False)).reshape(-1, 2)
        long = t[ends[:, 1] - 1] - t[ends[:, 0]] > REST_S
        parts += [(j, slice(a, b)) for a, b in ends[long].tolist()]
    return parts


def usual_of(
    changes: Changes,
    errors: int,
    held_out: Sequence[Scores],
    references: Sequence[Scores],
    delay_sigma: float = 0.0,
    of_model: float = 1.0,
    is_doubted: bool = False,
    later: Sequence[Scores] = (),
) -> Usual:
    """Usual changes and errors of a model from its own rows and from logs of reference.

    errors p: number of columns of the root; delay_sigma: of the delay that the model contains [s];
    of_model: default errors of the model, and of its postures, over those of an arm; is_doubted:
    the model is, as by friction that no column describes, so that no log is a simulation of it;
    later: a log that is tested, whose misfit counts where it is larger: a few seconds of held-out
    rows hardly show any, since their columns take it up.
    """
    logs, default = [*held_out, *references], np.array(list(USUAL.values()))
    default[[list(USUAL).index(kind) for kind in ("model", "posture")]] *= of_model
    scales = default.copy()
    if not references:
        is_known = held_out and not is_doubted
        misfit = max(each.misfit for each in (*held_out, *later)) if is_known else np.inf
        share = float(np.clip((misfit - 1) / FULL_MISFIT, 1e-3, 1.0))
        scales[: len(PLAUSIBLE)] *= share
        scales[-1] *= share
    else:

        def log_p(step: Array) -> tuple[float, float]:
            return _common(changes, errors, logs, default * np.exp(DOUBT * step), delay_sigma)[2:]

        scales = default * np.exp(DOUBT * _most_probable(log_p, len(default)))
    mean, covariance = _common(changes, errors, logs, scales, delay_sigma)[:2]
    freedom = float(FREEDOM * len(logs) if references else ASSUMED)
    return Usual(scales, mean, covariance, freedom, len(references))


def _most_probable(log_p: Callable[[Array], tuple[float, float]], count: int) -> Array:
    """Most probable steps of `count` scales, by log p and RMS [σ] of the scores at any steps."""
    # A search may leave the range of numbers.
    with suppress(ValueError, np.linalg.LinAlgError), np.errstate(over="ignore", invalid="ignore"):
        if log_p(np.full(count, FARTHEST))[1] <= FARTHEST:
            search = minimize(
                lambda step: 0.5 * float(step @ step) - log_p(step)[0],
                np.zeros(count),
                method="L-BFGS-B",
                options={"maxiter": 30, "ftol": 1e-5},
            )
            return np.asarray(search.x)
    raise IdentificationError(
        "the logs of reference are so far from the model that no usual change explains them; "
        "identify the robot again from one of them, or leave --reference out"
    )


def _common_part(changes: Changes, scores: Scores, scales: Array) -> tuple[Array, Array]:
    """Columns of (u, ε, shapes) in the scores of a log, and the covariance (r, r) about them."""
    columns = scores.columns[:, : len(changes.names)]
    wide = np.hstack(
        [columns, scores.error, scores.shape * np.repeat(changes.ranges, model_error.SHAPES)]
    )
    named = columns * changes.usual(scales)
    posture = scores.error * scales[list(USUAL).index("posture")]
    return wide, np.asarray(scores.noise + named @ named.T + posture @ posture.T)


def expected(changes: Changes, usual: Usual, scores: Scores) -> tuple[Array, Array]:
    """Mean (r,) and covariance (r, r) of the scores of a further log of a healthy robot."""
    wide, of_log = _common_part(changes, scores, usual.scales)
    return wide @ usual.mean, of_log + wide @ usual.covariance @ wide.T


def _common(
    changes: Changes, errors: int, logs: Sequence[Scores], scales: Array, delay_sigma: float
) -> tuple[Array, Array, float, float]:
    """Mean and covariance of (u, ε, shapes) given the logs; log p and RMS [σ] of their scores."""
    kinds = list(USUAL)
    sizes = [np.full(errors, scales[kinds.index("model")])]
    sizes += [np.full(model_error.SHAPES * len(changes.ranges), scales[kinds.index("shape")])]
    # What the model left on its own day is not small where the usual change is.
    first = np.maximum(changes.usual(scales), changes.usual(np.array(list(USUAL.values()))))
    first[changes.of("clock")] = np.hypot(first[changes.of("clock")], delay_sigma)
    before = np.concatenate([first, *sizes]) ** 2
    mean, covariance, log_p, squares = np.zeros(len(before)), np.diag(before), 0.0, 0.0
    for each in logs:
        wide, of_log = _common_part(changes, each, scales)
        across = covariance @ wide.T
        factor = cho_factor(of_log + wide @ across, lower=True)
        rest = each.z - wide @ mean
        solved = cho_solve(factor, rest)
        squares += float(rest @ solved)
        log_p -= 0.5 * float(rest @ solved) + float(np.log(np.diag(factor[0])).sum())
        mean = mean + across @ solved
        covariance = covariance - across @ cho_solve(factor, across.T)
    return mean, covariance, log_p, np.sqrt(squares / max(sum(len(each.z) for each in logs), 1))
