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
ms: rows of a measured torque near a reversal of a joint's speed are left out for that joint. So are
those of a commanded one where they are predicted far worse than the others (`TURNED`); else they
determine its delay best.
Source: profile likelihood of Gaussian noise with unknown variances (Murphy & van der Vaart 2000).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.special import chdtri

from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import (
    coloured_noise_of_basis,
    slow_cosines,
    slow_part,
)
from runtime.estimators.regression.model_error import FreeFit, nuisance_of, scatter
from runtime.estimators.regression.posterior import orthonormal, posterior_of
from runtime.estimators.regression.samples import NORMAL_95, Samples, samples_of
from runtime.library import Array, Integers, Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction.columns import ROTOR
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.preprocessing.segments import interpolate
from runtime.recording.recipes.recipe import COMMANDED

PASSES = 2  # passes in which the weights of the joints follow their residuals at the best delay
FLAT_S = 0.09  # width of the 99.9 % interval from which on the profile is flat [s]
ROWS, COARSE_ROWS = 900, 300  # rows of the profile (some hundred independent), of the coarse search
FEWEST_ROWS = 100  # rows below which no delay is estimated
STEP_S = 0.002  # step of the delays that are tried [s]; a parabola resolves fractions of it
LATEST_S, EARLIEST_S = 0.15, 0.03
"""Range of delays of a commanded torque behind its stamp, and before it [s]; the first is that of a
measured torque on both sides."""
CUTOFF_HZ, SHARE = 10.0, 0.2  # cut-off without a filter [Hz], and over the rate of a slow log
NEAR_S, SLIDING, LEAST_SHARE = 0.1, 0.1, 0.3
"""Time around a reversal that is left out [s]; speed over the largest one of the joint below which
friction may not slide; share of the rows that must remain, else all are used."""
CLOSE_S, SEEN_SHARE = 0.05, 0.05
"""The time of a commanded torque: legs turn round within 0.2 s; least share that shows friction."""


TURNED = 5.0
"""Squared residual near reversals over that of sliding joints from which on friction turns round in
another way than its columns: 1 of columns that are right, 3.4 on a Z1, 6.5 to 14 of friction with a
memory, 6.4 to 54 in MuJoCo, whose friction creeps."""


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

    Without gains (`has_gains` False) the joints share no parameters. Beside a measured torque,
    velocities are those logged, or those from q where they leave less and state another delay: a
    drive's velocity lags, and its noise, which a controller feeds back, looks like a delay.
    """
    usual = filtered(recording, preparation)
    given = (lib, preparation, terms, reach_s, has_gains)
    logged = _profile_of(recording, usual, *given)
    is_logged = usual.derivative == "measured" and recording.dq is not None
    if recording.torque_source == COMMANDED or not is_logged:
        return logged.profile
    from_q = replace(usual, derivative="position")
    derived = _profile_of(recording, from_q, *given, used=logged.used)
    # At the delay of the positions: another one would fit the noise that is fed back.
    at, (low, high) = derived.profile.best, logged.profile.interval
    is_kept = low <= at <= high or logged.left(at) <= derived.left(at)
    return (logged if is_kept else derived).profile


@dataclass(frozen=True, slots=True, eq=False)
class _Tried:
    """Profile with the velocities of one preparation."""

    profile: DelayProfile
    used: Array  # 1 in rows and joints that count, (N, n)
    losses: Array  # Σ_j N_j ln s_j² at the delays of the profile, (M,)

    def left(self, delay: float) -> float:
        """Loss at a delay [s]."""
        return float(np.interp(delay, self.profile.delays, self.losses))


def _profile_of(
    recording: Recording,
    usual: Preparation,
    lib: Library,
    preparation: Preparation,
    terms: Friction,
    reach_s: float,
    has_gains: bool,
    used: Array | None = None,
) -> _Tried:
    """Profile of the loss with one preparation, in rows `used` if these are known."""
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
    if used is None and not commanded:
        used = _far_from_reversals(every.dq, whole.rate_hz, usual.cutoff_hz or CUTOFF_HZ, rows)
    counted = np.ones_like(samples.tau) if used is None else used

    def rows_of(some: Samples) -> Array:
        """The columns, and the torque of the URDF where it counts, in the last one."""
        if commanded:
            return np.dstack([some.friction_rows(), some.rigid(lib, lib.pi0)])
        springs = [lib.spring_columns(some.q)] if lib.manifest.springs else []
        return np.dstack([some.rows_of_unknowns(lib), *springs, 0 * some.tau])

    both = rows_of(samples)
    columns, model = both[..., :-1], both[..., -1]
    rates = (rows_of(every.rows(rows + 1)) - rows_of(every.rows(rows - 1))) * whole.rate_hz / 2
    known = stated_delay(preparation)

    def fit_of(step: int) -> _Fit:
        few, weight = slice(None, None, step), counted[::step]

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
    fit = fit_of(1)
    solved = fit.solved(delays)
    seen = sliding(every.dq, whole.rate_hz, least=SEEN_SHARE, rows=rows)
    if commanded and fit.reversal_excess(delays[[solved.best]], seen) > TURNED:
        counted = sliding(every.dq, whole.rate_hz, CLOSE_S, rows=rows)
        fit = fit_of(1)
        solved = fit.solved(delays)
    profile = replace(fit.profile(delays, solved), sign=sign_of_delay(recording))
    return _Tried(profile, counted, solved.losses[:-1])


def _far_from_reversals(dq: Array, rate_hz: float, cutoff_hz: float, rows: Integers) -> Array:
    """`sliding`; the low-pass spreads a reversal over its period, where joints slide for longer."""
    far_s = min(max(NEAR_S, 1.0 / cutoff_hz), 2 * NEAR_S)
    far, near = (sliding(dq, rate_hz, s, rows=rows) for s in (far_s, NEAR_S))
    return np.where(far.all(axis=0), near, far)


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


def sliding(
    dq: Array,
    rate_hz: float,
    near_s: float = NEAR_S,
    least: float = LEAST_SHARE,
    rows: Integers | slice = slice(None),
) -> Array:
    """1 in some rows and joints farther than `near_s` from a reversal of dq, else 0, (N, n).

    Of joints of which a smaller share than the least is, all rows count.
    """
    slow = np.abs(dq) < SLIDING * np.abs(dq).max(axis=0)
    width = 2 * round(near_s * rate_hz) + 1
    near = maximum_filter1d(slow.astype(np.uint8), width, axis=0, mode="nearest")
    used = 1.0 - near[rows]
    used[:, used.mean(axis=0) <= least] = 1.0
    return np.asarray(used)


def reversal_excess(rest: Array, used: Array) -> float:
    """Squared residual in rows near reversals over that in sliding ones, mean of the joints.

    rest (N, n), used (N, n) of `sliding`; 0 where no joint has both.
    """
    both = ~used.all(axis=0)
    if not both.any():
        return 0.0
    rest, used = rest[:, both] ** 2, used[:, both]
    turns, slides = (np.sum(rest * w, axis=0) / w.sum(axis=0) for w in (1 - used, used))
    return float(np.exp(np.mean(np.log(turns / slides))))


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

    def reversal_excess(self, delay: Array, seen: Array) -> float:
        """`reversal_excess` at a delay (1,) with free links: errors of the URDF would hide it."""
        rows = np.dstack([self.rows, self.samples.base_rows(self.lib)])
        return reversal_excess(replace(self, rows=rows).solved(delay).rests[0], seen)

    def profile(self, delays: Array, solved: _Solved) -> DelayProfile:
        """Profile of the loss over delays (M,) [s], from least squares at them."""
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
            # The loss is that of residuals without the most probable nuisance torque. What it moves
            # δ by stays an error of that size: the shapes of a robot are not quite those assumed.
            # Friction that depends on the position is an error alone: it takes up 4 of 30 ms of the
            # Z1's log.
            nuisance = nuisance_of(self.lib, fit, self.lib.pi0, level, with_position=False)
            wider = nuisance_of(self.lib, fit, self.lib.pi0, level)
            level += float(np.sum(wider.error[0] ** 2))
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
