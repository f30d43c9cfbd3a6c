"""Delay between the torque and the motion of a recording, from the profile of the loss.

    τ(t + δ) = Y π0 + F φ + e      links of the URDF, or free base parameters Y_b β instead of Y π0

A commanded torque is fitted with the links of the URDF: friction and rotor inertia dominate it, and
free links would imitate a delay (kp d dq like viscous friction, kd d ddq like inertia).

The profile is that of linear least squares at every delay:

    τ(t + δ) = W x + e,   L(δ) = Σ_j N_eff/2 · ln s_j²(δ),   s_j² the residual variance of joint j

δ is the time by which the log stamps τ late (`Preparation.torque_delay_s`); a commanded torque that
acts d later has δ = −d. N_eff counts the scatter of the score dL/dδ between blocks (`model_error`).
The interval holds all δ with L(δ) − L(δ̂) ≤ 1.92, half the 95 % quantile of χ² with one degree of
freedom. Friction has a memory and lags behind the sign of dq, which looks like a delay of some 20
ms: rows of a measured torque near a reversal of a joint's speed are left out for that joint.
Source: profile likelihood of Gaussian noise with unknown variances (Murphy & van der Vaart 2000).

Dry friction of drives: with a memory or without, the same everywhere or changing with q.

    e = τ(t + δ) − Y π0 − F φ,   F with coulomb or dahl, each without and with position

A linkage or a cable makes friction change with the position. Candidates are compared joint by joint
by cross-validation on contiguous blocks. A memory, with the stroke z_c of a reversal, and a delay
both make the torque of a reversal late: where the delay is unknown, a memory has to pay at the δ
that is best without it, and then has a δ of its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.special import chdtri

from runtime.common.tables import significant
from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import (
    coloured_noise_of_basis,
    slow_cosines,
    slow_part,
)
from runtime.estimators.regression.model_error import FreeFit, nuisance_of, scatter
from runtime.estimators.regression.posterior import orthonormal, posterior_of
from runtime.estimators.regression.samples import NORMAL_95, Samples, samples_of
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction.columns import COULOMB, DAHL, POSITION, ROTOR
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.preprocessing.segments import interpolate
from runtime.recording.recipes.recipe import COMMANDED

PASSES = 2  # passes in which the weights of the joints follow their residuals at the best delay
FLAT_S = 0.09  # width of the 99.9 % interval from which on the profile is flat [s]
ROWS, COARSE_ROWS = 900, 300
"""Rows of the profile, of which some hundred are independent, and of the coarse search."""
FEWEST_ROWS = 100  # rows below which no delay is estimated
STEP_S = 0.002  # step of the delays that are tried [s]; a parabola resolves fractions of it
LATEST_S, EARLIEST_S = 0.15, 0.03
"""Range of delays of a commanded torque behind its stamp, and before it [s]; the first is that of a
measured torque on both sides."""
CUTOFF_HZ, SHARE = 10.0, 0.2
"""Cut-off where the preparation has no filter [Hz], and the same over the rate of a slow log."""
NEAR_S, SLIDING, LEAST_SHARE = 0.1, 0.1, 0.3
"""Time around a reversal that is left out [s]; speed over the largest one of the joint below which
friction may not slide; share of the rows that must remain, else all are used."""


@dataclass(frozen=True, slots=True, eq=False)
class DelayProfile:
    """Loss over δ = `Preparation.torque_delay_s` of a recording."""

    delays: Array  # δ that were tried, (M,) [s], ascending
    loss: Array  # L(δ) − min L, (M,); 1.92 at the ends of the interval
    best: float  # δ̂, least point of a parabola through the three lowest losses [s]
    interval: tuple[float, float]  # first and last δ within the interval [s]
    # share of the squared residual at the delay of the preparation, else at none, that δ̂ removes:
    # geometric mean of the joints
    gain: float
    # of the delay d in δ = sign · d: −1 for a commanded torque, which acts later than it is
    # stamped, 1 for a measured one, which is stamped later than it acts
    sign: float = 1.0

    @property
    def delay_s(self) -> float:
        """d̂ [s]."""
        return self.sign * self.best

    @property
    def interval_s(self) -> tuple[float, float]:
        """95 % interval of d [s]."""
        first, last = sorted(self.sign * end for end in self.interval)
        return first, last

    @property
    def is_flat(self) -> bool:
        """Whether the data do not determine a delay within the range."""
        # A delay that is determined has its 99.9 % interval within the delays tried.
        low, high = _interval(self.delays, self.loss, chdtri(1, 0.001) / 2)
        return bool(low <= self.delays[0] or high >= self.delays[-1] or high - low > FLAT_S)

    @property
    def sigma(self) -> float:
        """Standard deviation whose 95 % interval is as wide as that of δ [s]."""
        return (self.interval[1] - self.interval[0]) / (2 * NORMAL_95)


def sign_of_delay(recording: Recording) -> float:
    """Sign of the delay d in `Preparation.torque_delay_s` = sign · d."""
    return -1.0 if recording.torque_source == COMMANDED else 1.0


def with_delay(recording: Recording, preparation: Preparation, delay: Array) -> Preparation:
    """The preparation with δ = sign · d of a delay d, (1,) or (n,) [s]; with none where it is 0."""
    late = tuple((sign_of_delay(recording) * delay).tolist())
    stated = late[0] if len(late) == 1 else late
    return replace(preparation, torque_delay_s=stated if any(late) else None)


def recorded_delay(
    recording: Recording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    reach_s: float = LATEST_S,
    *,
    has_gains: bool = True,
) -> DelayProfile:
    """Profile of the loss over the delay of a recording, to `reach_s` of a measured torque.

    Without gains (`has_gains` False) the joints share no parameters.
    """
    usual = filtered(recording, preparation)
    commanded = recording.torque_source == COMMANDED
    if usual.cutoff_hz:  # between rows, interpolation damps noise near the Nyquist frequency
        usual = replace(usual, cutoff_hz=min(usual.cutoff_hz, SHARE * recording.rate_hz))
    bare = recording.replace(columns=None, column_names=(), motors=None)
    whole = prepare(bare, usual, terms, lib=lib)
    first, last = (-LATEST_S, EARLIEST_S) if commanded else (-reach_s, reach_s)
    t = whole.t
    rows = np.flatnonzero((t + first >= t[0]) & (t + last <= t[-1]))
    rows = rows[:: max(1, len(rows) // ROWS)]
    if len(rows) < FEWEST_ROWS:
        raise IdentificationError(
            f"expected {FEWEST_ROWS} rows or more to estimate a delay, got {len(rows)}; record for "
            "longer, or give the delay in the recipe (torque_delay_s under [preparation])"
        )
    every = samples_of(whole, lib)
    samples, tau = every.rows(rows), every.tau
    used = np.ones_like(samples.tau)
    if not commanded:
        used = _sliding(every.dq, whole.rate_hz)[rows]
        used[:, used.mean(axis=0) <= LEAST_SHARE] = 1.0

    def rows_of(some: Samples) -> Array:
        """The columns, and the torque of the URDF where it counts, in the last one."""
        if commanded:
            return np.dstack([some.friction_rows(), some.rigid(lib, lib.pi0)])
        springs = [lib.spring_columns(some.q)] if lib.manifest.springs else []
        return np.dstack([some.base_rows(lib), some.friction_rows(), *springs, 0 * some.tau])

    both = rows_of(samples)
    columns, model = both[..., :-1], both[..., -1]
    rates = (rows_of(every.rows(rows + 1)) - rows_of(every.rows(rows - 1))) * whole.rate_hz / 2
    known = stated_delay(preparation)

    def fit_of(step: int) -> _Fit:
        few, weight = slice(None, None, step), used[::step]

        def torque(delay: float) -> Array:
            return weight * (interpolate(t[rows[few]] + delay, t, tau) - model[few])

        shown, slopes = columns[few] * weight[:, :, None], rates[few]
        if not has_gains:
            shown, slopes = _apart(shown), np.dstack([_apart(slopes[..., :-1]), slopes[..., -1]])
        return _Fit(lib, samples.rows(few), shown, slopes, torque, known, weight)

    # A coarse search of the whole range finds the valley, whose width is a quarter of the period.
    width = 0.25 / (preparation.cutoff_hz or CUTOFF_HZ)
    width = STEP_S * float(np.ceil(max(width, 4 / recording.rate_hz) / STEP_S))
    if not commanded:
        tried = np.linspace(first, last, round(2 * (last - first) / width) + 1)
        solved = fit_of(max(1, len(rows) // COARSE_ROWS)).solved(tried)
        coarse = vertex(tried, solved.losses[:-1], solved.best)
        first, last = max(first, coarse - 2 * width), min(last, coarse + 2 * width)
    steps = range(round(first / STEP_S), round(last / STEP_S) + 1)
    delays = np.array([STEP_S * k for k in steps])
    return replace(fit_of(1).profile(delays), sign=sign_of_delay(recording))


def delay_of_log(
    recording: Recording,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    split: Split | None = None,
    *,
    has_rotors: bool = True,
) -> DelayProfile:
    """Profile of the rows before the test part, as the other passes of `identify` have them.

    A measured torque has columns of rotors (`has_rotors`), which the sensor may see or not.
    """
    measured = recording.torque_source != COMMANDED
    if measured and has_rotors and ROTOR.name not in terms.columns and not terms.gear:
        terms = replace(terms, columns=(*terms.columns, ROTOR.name))
    return recorded_delay(before_test(recording, split), lib, preparation, terms)


def _apart(columns: Array) -> Array:
    """Columns (N, n, p) where every joint has parameters of its own, (N, n, n p)."""
    joints = np.eye(columns.shape[1])[:, :, None]
    return np.asarray((columns[:, :, None] * joints).reshape(*columns.shape[:2], -1))


def stated_delay(preparation: Preparation) -> float:
    """δ of a preparation [s], 0 for none; of delays per joint their mean."""
    return float(np.mean(preparation.torque_delay_s or 0.0))


def _sliding(dq: Array, rate_hz: float) -> Array:
    """1 in rows and joints far from a reversal of the speed, else 0, (N, n)."""
    slow = np.abs(dq) < SLIDING * np.abs(dq).max(axis=0)
    width = 2 * round(NEAR_S * rate_hz) + 1
    near = maximum_filter1d(slow.astype(np.uint8), width, axis=0, mode="nearest")
    return np.asarray(1.0 - near)


def filtered(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation without delay, decimation and removal of rest, with a low-pass."""
    usual = replace(
        preparation, rate_hz=None, rest_speed=None, torque_delay_s=None, regressor="acceleration"
    )
    if usual.filter != "none":
        return usual
    cutoff = min(CUTOFF_HZ, SHARE * recording.rate_hz)
    grid = usual.max_gap_s or float(f"{4.0 / recording.rate_hz:.3g}")
    trim = float(f"{min(1.0 / cutoff, 0.05 * recording.duration):.3g}")
    return replace(usual, filter="butterworth", cutoff_hz=cutoff, max_gap_s=grid, trim_s=trim)


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """Least squares at M delays, and in the last row at the delay that the gain is relative to."""

    best: int  # index of the lowest loss
    rests: Array  # residuals, (M + 1, N, n) [N·m, N]
    variance: Array  # s_j², (M + 1, n)
    losses: Array  # Σ_j N_j ln s_j², (M + 1,)
    scale: Array  # 1 / s_j at the best delay, (n,)
    least: float  # variance of rounding [N²·m², N²]


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Linear least squares at every delay."""

    lib: Library
    samples: Samples
    rows: Array  # W, (N, n, p)
    rates: Array  # dW/dt of all rows, and that of the URDF's torque, (N, n, p + 1)
    torque: Callable[[float], Array]  # τ(t + δ) of a delay, (N, n)
    known: float  # δ that the gain is relative to [s]
    used: Array  # 1 in rows that are not 0, (N, n)

    def solved(self, delays: Array) -> "_Solved":
        """Residuals and losses at delays (M,) and at the known one [s]."""
        p = self.rows.shape[2]
        counts = self.used.sum(axis=0)
        shifted = np.stack([self.torque(float(delay)) for delay in (*delays, self.known)])
        start = shifted[int(np.argmin(np.abs(delays)))]
        scale = 1.0 / np.maximum(start.std(axis=0), 1e-12 * float(start.std()) + 1e-300)
        best, rests = 0, shifted
        for _ in range(PASSES):
            # Weighted orthonormal basis of the columns: one product for all delays.
            basis = orthonormal((self.rows * scale[:, None]).reshape(-1, p))
            target = (shifted * scale).reshape(len(shifted), -1)
            rests = (target - target @ basis @ basis.T).reshape(shifted.shape) / scale
            variance = np.sum(rests**2, axis=1) / counts
            floor = 1e-12 * float(np.mean(start**2)) + 1e-300
            logs = np.log(np.maximum(variance, floor))
            best = int(np.argmin(logs[:-1] @ counts))
            scale = 1.0 / np.sqrt(np.maximum(variance[best], floor))
        return _Solved(best, rests, variance, logs @ counts, scale, floor)

    def profile(self, delays: Array) -> DelayProfile:
        """Profile of the loss over delays (M,) [s]."""
        solved = self.solved(delays)
        best, rests, variance, scale = solved.best, solved.rests, solved.variance, solved.scale
        whole = (self.rows * scale[:, None]).reshape(-1, self.rows.shape[2])
        basis = orthonormal(whole)
        # Slope of the torque that the fit predicts: that of the residuals is mostly noise where the
        # motion is slow, and nuisance torque would look small beside it.
        x = posterior_of(whole, (self.torque(float(delays[best])) * scale).ravel()).mean
        slope = slow_part(self.rates @ np.append(x, 1.0), slow_cosines(self.samples)) * self.used
        pair, shape = np.dstack([rests[best] * scale, slope * scale]).reshape(-1, 2), slope.shape
        rest, slope = (pair - basis @ (basis.T @ pair)).T
        stretch = basis.reshape(*shape, -1), rest.reshape(shape)
        level = coloured_noise_of_basis([stretch], 1).inflation
        losses, counts = solved.losses, self.used.sum(axis=0)
        if slope.any():  # the score of δ scatters between blocks, and contains nuisance torque
            slope = slope[:, None] / np.linalg.norm(slope)
            level = max(level, float(scatter(self.samples, slope, stretch[1], level)[0, 0]))
            beside, none = np.hstack([slope, basis]), np.zeros((0, 0))
            fit = FreeFit(self.samples, scale * self.used, none, beside, rest, rest, ())
            nuisance = nuisance_of(self.lib, fit, self.lib.pi0, level)
            # The loss is that of residuals without the most probable nuisance torque. What it moves
            # δ by stays an error of that size: the shapes of a robot are not quite those assumed.
            level += float(np.sum(nuisance.error[0] ** 2))
            rests = rests - (nuisance.mean + nuisance.moved[0] * slope.reshape(shape)) / scale
            variance = np.sum(rests**2, axis=1) / counts
            losses = np.log(np.maximum(variance, solved.least)) @ counts
            best = int(np.argmin(losses[:-1]))
        losses = losses / level / 2
        loss = losses[:-1] - losses[:-1].min()
        used = (variance[best] > 0) & (variance[-1] > 0)
        ratio = np.log(variance[best, used] / variance[-1, used])
        gain = float(1.0 - np.exp(ratio.mean())) if used.any() else 0.0
        ends = _interval(delays, loss, chdtri(1, 0.05) / 2)
        return DelayProfile(delays, loss, vertex(delays, loss, best), ends, gain)


def vertex(x: Array, y: Array, k: int) -> float:
    """Least point of the parabola through the lowest value and its neighbours."""
    if not 0 < k < len(x) - 1:
        return float(x[k])
    low, mid, high = y[k - 1 : k + 2]
    curve = low - 2 * mid + high
    shift = (x[k + 1] - x[k]) * (high - low) / (2 * curve) if curve > 0 else 0.0
    return float(x[k] - shift)


def _interval(x: Array, y: Array, limit: float) -> tuple[float, float]:
    """Outermost crossings of a limit; √y of a parabola is linear."""
    root, level = np.sqrt(y), np.sqrt(limit)
    inside = np.flatnonzero(y <= limit)
    ends = []
    for i, j in ((int(inside[0]), int(inside[0]) - 1), (int(inside[-1]), int(inside[-1]) + 1)):
        if not 0 <= j < len(x):
            ends.append(float(x[i]))
            continue
        share = (level - root[i]) / (root[j] - root[i])
        ends.append(float(x[i] + share * (x[j] - x[i])))
    return ends[0], ends[1]


DRY, MEMORY, ALONG = COULOMB.name, DAHL.name, POSITION.name
STROKES = tuple(5e-4 * 2.0 ** (k / 2) for k in range(7))
"""Strokes z_c that are tried [rad, m]; a parabola resolves fractions of their steps."""
DELAY_STEP_S = 0.005  # step of the delays that are tried [s]
FOLDS = 5
LEAST_GAIN = 0.1
"""Share by which further columns have to lower the mean square error (geometric mean of joints)."""
_RANK = 1e-10  # eigenvalue of a Gram matrix of unit columns, over the largest, below which it is 0


@dataclass(frozen=True, slots=True)
class _Trial:
    """Rows on which further columns are tried."""

    # those of the terms, then `position`, then `dahl` and `position` of each stroke, (N, n, k); of
    # the joints that move
    columns: Array
    rest: Array  # torque less the rigid model of the URDF, at every delay, (M, N, n) [N·m, N]
    count: int  # number of columns of the terms
    place: int  # of `coulomb` among them

    def losses(self, memory: int | None, position: bool) -> Array:
        """Mean of ln s_j² over the joints, of every delay, (M,), with the stroke of an index."""
        chosen = list(range(self.count))
        if memory is not None:
            chosen[self.place] = self.count + 1 + 2 * memory
        if position:
            chosen.append(self.count if memory is None else self.count + 2 + 2 * memory)
        errors = _errors(self.columns[:, :, chosen], self.rest)
        return np.asarray(np.log(np.maximum(errors, np.finfo(float).tiny)).mean(axis=1))


def _trial(whole: Recording, lib: Library, terms: Friction, late: bool) -> _Trial | None:
    """At most `ROWS` rows of a prepared recording; None for too few, or without motion."""
    samples, t = samples_of(whole, lib), whole.t
    delays: Array = np.zeros(1)
    if late:
        first, last = round(-LATEST_S / DELAY_STEP_S), round(EARLIEST_S / DELAY_STEP_S)
        delays = np.asarray(DELAY_STEP_S * np.arange(first, last + 1))
    rows = np.flatnonzero((t + delays[0] >= t[0]) & (t + delays[-1] <= t[-1]))
    if len(rows) < FEWEST_ROWS:
        return None
    rows = rows[:: -(-len(rows) // ROWS)]
    samples = samples.rows(rows)
    count, place = len(terms.columns), terms.columns.index(DRY)
    moving = samples.columns[:, :, place].any(axis=0)  # by dq, without which there is no sign of it
    if not moving.any():
        return None
    model, torques = samples.rigid(lib, lib.pi0), whole.required("tau").T
    rest = np.array(
        [
            np.stack([np.interp(t[rows] + d, t, row) for row in torques], axis=1) - model
            for d in delays
        ]
    )
    return _Trial(samples.columns[:, moving], rest[:, :, moving], count, place)


def with_dry_friction(
    logs: Sequence[tuple[Recording, Preparation]], lib: Library, terms: Friction, late: bool
) -> tuple[Friction, str]:
    """Friction terms of commanded torques for which no command names any, common to the logs."""
    if DRY not in terms.columns:
        return terms, ""
    trials = list[_Trial]()
    for recording, preparation in logs:
        known = None if late else preparation.torque_delay_s
        usual = replace(filtered(recording, preparation), torque_delay_s=known)
        more = replace(terms, columns=(*terms.columns, ALONG))
        others = [Friction((MEMORY, ALONG), dahl_stroke=stroke) for stroke in STROKES]
        trial = _trial(prepare(recording, usual, more, *others, lib=lib), lib, terms, late)
        if trial is not None:
            trials.append(trial)
    if not trials:
        return terms, ""
    # Simplest first: a further column has to pay at the delays that the simplest model has.
    simplest = [trial.losses(None, False) for trial in trials]
    at = [int(loss.argmin()) for loss in simplest]
    share = np.array([len(trial.columns) for trial in trials], dtype=float)
    share /= share.sum()

    def loss_at(losses: Sequence[Array], places: Sequence[int]) -> float:
        return float(sum(w * loss[k] for w, loss, k in zip(share, losses, places, strict=True)))

    no_memory = [trial.losses(None, True) for trial in trials]
    memory = {
        each: [[trial.losses(k, each) for trial in trials] for k in range(len(STROKES))]
        for each in (False, True)
    }
    candidates = [
        (loss_at(simplest, at), False, False),
        (loss_at(no_memory, at), False, True),
        *((min(loss_at(loss, at) for loss in memory[each]), True, each) for each in (False, True)),
    ]
    enough = min(loss for loss, *_ in candidates) - np.log(1 - LEAST_GAIN)
    least, has_memory, has_position = next(each for each in candidates if each[0] <= enough)
    if not has_memory and not has_position:
        return terms, ""
    chosen, stroke = terms, None
    if has_memory:  # its stroke and the delays that are best with it
        best = [
            loss_at(losses, [int(loss.argmin()) for loss in losses])
            for losses in memory[has_position]
        ]
        least, stroke = min(best), float(f"{minimum_on_grid(STROKES, best):.3g}")
        names = tuple(MEMORY if name == DRY else name for name in terms.columns)
        chosen = replace(terms, columns=names, dahl_stroke=stroke)
    if has_position:
        chosen = replace(chosen, columns=(*chosen.columns, ALONG))
    fall = 100 * (1 - np.exp((least - candidates[0][0]) / 2))
    kinds = [f"has a memory of {stroke:.2g} rad of travel (column dahl)"] if stroke else []
    kinds += ["changes with the position (column position)"] * has_position
    return chosen, (
        f"dry friction {' and '.join(kinds)}: the error of cross-validation falls by "
        f"{significant(fall)} %; --friction {','.join(terms.columns)} leaves it out"
    )


def _errors(columns: Array, rest: Array) -> Array:
    """Sums of squares of what the other blocks predict of each block."""
    lengths = np.linalg.norm(columns, axis=0)
    x = np.moveaxis(columns / np.where(lengths > 0, lengths, 1.0), 0, 1)  # (n, N, k)
    y = np.moveaxis(rest, 0, 2).swapaxes(0, 1)  # (n, N, M)
    edges = np.linspace(0, x.shape[1], FOLDS + 1).astype(int)
    blocks = [slice(*pair) for pair in pairwise(edges)]
    gram = np.array([x[:, b].swapaxes(1, 2) @ x[:, b] for b in blocks])
    cross = np.array([x[:, b].swapaxes(1, 2) @ y[:, b] for b in blocks])
    phi = np.linalg.pinv(gram.sum(axis=0) - gram, rcond=_RANK, hermitian=True) @ (
        cross.sum(axis=0) - cross
    )
    left = [np.sum((y[:, b] - x[:, b] @ p) ** 2, axis=1) for b, p in zip(blocks, phi, strict=True)]
    return np.asarray(np.sum(left, axis=0).T)


def minimum_on_grid(places: Sequence[float] | Array, losses: Sequence[float] | Array) -> float:
    """Vertex of the parabola over ln x through the smallest loss and its neighbours."""
    best = int(np.argmin(losses))
    if not 0 < best < len(losses) - 1:
        return float(places[best])
    low, middle, high = (float(loss) for loss in losses[best - 1 : best + 2])
    bend = low - 2 * middle + high
    shift = 0.5 * (low - high) / bend if bend > 0 else 0.0
    return float(places[best] * np.exp(shift * np.log(places[best + 1] / places[best])))
