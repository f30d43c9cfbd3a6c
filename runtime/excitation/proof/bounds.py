"""Bounds over all t of limits: of each joint, and of those that are not linear in the motion.

On an interval of length δ between two samples a function lies below its chord by Taylor: g ≤
max(g_k, g_k+1) + δ²/8 sup g''.

- position, velocity, acceleration and jerk of each joint: PROVEN. Within an interval |g''| ≤
  max(|g''_k|, |g''_k+1|) + δ/2 Σ|a| sup|φ'''| (of g). All derivatives are closed forms of the
  basis, so the bound is proven up to rounding, which is added. The fifth one of a spline jumps at
  knots, from one constant to the next, both of which are among the samples. The same inequality on
  long intervals shows which of them may hold the largest bound of short ones: only these are
  divided, and the result is that of short intervals everywhere.
- braking: PROVEN. h = max(0, s dq + c)²/k + s q has h'' ≤ 2 (ddq² + max(0, s dq + c) |dddq|)/k
  + |ddq|, and each factor is bounded on the interval by its ends and the next derivative.
- torque, torque rate, tip box and speed, self-collision, table: PROVEN by division, where the
  robot has kernels of bounds.
- position and velocity of joints that follow several others: PROVEN by division, as linear
  combinations of the motion; of joints that a closed loop moves: MEASURED.
- the same limits of robots with closed loops, and torque and torque rate of robots with springs of
  known stiffness or torque curves: MEASURED, not proven. ġ is exact at every sample (by kernels
  along the motion's derivatives, of springs by differences); g'' on an interval is taken
  as `SAFETY` times the largest change of ġ over δ there and on both neighbouring intervals. The
  fastest wave of a motion, M / t_f, has hundreds of samples per period, so that neighbours suffice.
  Where the closest points of two links jump, ġ jumps too and the bound grows, never shrinks.

A proof divides intervals: on an interval g lies below its larger end by a proven `rise` at most:
δ²/8 sup |g''| of torques, torque rates and the tip, δ/2 sup |g'| of distances. Intervals whose
bound exceeds the largest value at an end by more than a tolerance are divided. The tolerance of a
row is a share of its margin.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.nonlinear_limits import (
    Braking,
    Constraint,
    IntervalBounds,
    SampledMotion,
    TimedConstraint,
)
from runtime.excitation.limits.torque_limits import TorqueLimit
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import Trajectory
from runtime.library import Array, Indices, Library

INTERVALS = 4000  # fewest intervals of the grid over half the duration, twice as many over all
INTERVALS_PER_HARMONIC = 3000  # error δ²/8 (2πM/t_f)² of chords below 2e-7 of the amplitude
DIVIDED = 20  # short intervals in a long one; divides both numbers above
ROUNDING = 64 * np.finfo(float).eps  # over Σ|a| sup|φ|: 2πms has a few ε, M products
KINDS = ("position", "velocity", "acceleration", "jerk")
_ORDERS = len(KINDS) + 2  # number of derivatives that are evaluated


def joint_bounds(lib: Library, trajectory: Trajectory) -> tuple[Array, Array]:
    """Proven bounds of position to jerk; of a motion that is its own mirror image, of one half."""
    _require_shapes(lib, trajectory)
    a, basis = trajectory.coefficients, trajectory.basis
    # A grid of `count` short intervals of length `step` in s = t/t_f.
    n, size = a.shape
    count = interval_count(trajectory)
    step = (0.5 if basis.is_symmetric else 1.0) / count
    sides = rooms(lib, trajectory.home)
    chords = _Chords.of(trajectory, *sides)
    value, bend = _curves(_ends(basis, size, DIVIDED * step, count // DIVIDED), a)
    # Long intervals: the bound of any short interval inside one is below this, as the chord of
    # the long one and that of the short one are both counted (1 + 20² and 1 + 20).
    bounds = chords.bounds(value, bend, (1 + DIVIDED**2) * step**2 / 8, (1 + DIVIDED) * step / 2)
    # A long interval may hold the maximum where its bound exceeds the largest value at an end.
    chosen = bounds > chords.shares(value).max(axis=2, keepdims=True)
    np.put_along_axis(chosen, np.argmax(bounds, axis=2)[..., None], True, axis=2)  # the first NaN
    order, joint, interval = np.nonzero(chosen)
    used, back = np.unique(interval, return_inverse=True)
    # Only those are divided into short intervals and evaluated again.
    points = DIVIDED * used[:, None] + np.arange(DIVIDED + 1)  # (U, 21)
    phi = basis.derivatives(_ORDERS, size, step * points.ravel().astype(float))
    curves = (curve.reshape(len(KINDS), n, *points.shape) for curve in _curves(phi, a))
    value, bend = (curve[order, joint, back] for curve in curves)
    bounds = chords.of_rows(order, joint).bounds(value, bend, step**2 / 8, step / 2)
    # The largest bound of every kind and joint; its time is the middle of the interval.
    best, where = np.empty((2, len(KINDS), n))
    starts = np.flatnonzero(np.diff(order * n + joint, prepend=-1))
    for first, last in zip(starts, [*starts[1:], len(order)], strict=True):
        row, k = divmod(int(np.argmax(bounds[first:last])), DIVIDED)
        best[order[first], joint[first]] = bounds[first + row, k]
        where[order[first], joint[first]] = points[back[first + row], k] + 0.5
    # Without room between home and a limit no motion keeps it; a NaN stays one.
    best[np.minimum(*sides) <= 0] = np.inf
    return best, where * step * trajectory.duration


def interval_count(trajectory: Trajectory) -> int:
    """Number of short intervals, bounded by the long ones where these suffice."""
    size, basis = trajectory.coefficients.shape[1], trajectory.basis
    return max(INTERVALS, INTERVALS_PER_HARMONIC * size) * (1 if basis.is_symmetric else 2)


@dataclass(frozen=True, slots=True)
class _Chords:
    """The inequality of the module's head, for derivatives by s."""

    up: Array  # up, down: limits
    down: Array
    third: Array  # Σ|a| sup of the third derivative
    rounding: Array  # of the value

    @classmethod
    def of(cls, trajectory: Trajectory, up: Array, down: Array) -> "_Chords":
        """For all kinds and joints, (4, n, 1) each."""
        size = trajectory.coefficients.shape[1]
        sup = np.array([trajectory.basis.bound(k, size) for k in range(len(KINDS) + 3)])
        sup = sup @ np.abs(trajectory.coefficients).T
        unit = trajectory.duration ** np.arange(len(KINDS))[:, None]
        sides = (np.where(room > 0, room, np.nan) * unit for room in (up, down))
        every = *sides, sup[3:], ROUNDING * sup[: len(KINDS)]
        return cls(*(part[..., None] for part in every))

    def of_rows(self, order: Indices, joint: Indices) -> "_Chords":
        """For chosen kinds and joints, (K, 1) each."""
        every = self.up, self.down, self.third, self.rounding
        return _Chords(*(part[order, joint] for part in every))

    def shares(self, value: Array) -> Array:
        """Shares of the limits that values use."""
        return np.maximum(value / self.up, -value / self.down)

    def bounds(self, value: Array, bend: Array, half_square: float, half: float) -> Array:
        """Bounds over intervals between neighbours of the last axis; bend = |g''|, δ²/8, δ/2."""
        rise = np.maximum(bend[..., 1:], bend[..., :-1]) + half * self.third
        rise = half_square * rise + self.rounding
        high = np.maximum(value[..., 1:], value[..., :-1]) + rise
        low = rise - np.minimum(value[..., 1:], value[..., :-1])
        return np.asarray(np.maximum(high / self.up, low / self.down))


def _curves(phi: Array, a: Array) -> tuple[Array, Array]:
    """Values and |second derivatives| of all kinds, (4, n, N), from φ (orders, N, M)."""
    curves = np.ascontiguousarray((phi @ a.T).swapaxes(1, 2))
    return curves[: len(KINDS)], np.abs(curves[2:])


@lru_cache(maxsize=8)
def _ends(basis: Basis, size: int, step: float, count: int) -> Array:
    """Derivatives d^k φ_m/ds^k at the ends of long intervals, shared by the stages of a motion."""
    return basis.derivatives(_ORDERS, size, step * np.arange(count + 1.0))


def rooms(lib: Library, home: Array) -> tuple[Array, Array]:
    """Limits up and down per kind and joint, (4, n); those of the position count from home."""
    limits = lib.limits()
    same = [limits[kind] for kind in KINDS[1:]]
    return np.array([limits["upper"] - home, *same]), np.array([home - limits["lower"], *same])


def _require_shapes(lib: Library, trajectory: Trajectory) -> None:
    a, home, n = trajectory.coefficients, trajectory.home, lib.n_joints
    shaped = home.shape == (n,) and a.ndim == 2 and len(a) == n and a.size > 0
    if not shaped or not trajectory.duration > 0:
        raise IdentificationError(
            f"a trajectory of '{lib.name}' needs a home of shape ({n},), coefficients of shape "
            f"({n}, M) and a positive duration, got {home.shape}, {a.shape} and "
            f"{trajectory.duration:g} s"
        )


SHARE = 0.01  # tolerance of a bound as a share of the margin of its row
PARTS = 4  # parts of an interval that is divided
MOST_INTERVALS = 1_000_000  # of a constraint; undecided ones keep a proven, looser bound
STEP = 1e-3  # longest interval, s
LEAST_INTERVALS = 2000  # fewest intervals of a `MotionGrid`, however short the motion
ORDERS = 5  # number of derivatives of the motion that are evaluated, q included
SAFETY = 2.0
_CHUNK = 2048  # intervals at once: their Jacobians stay in the cache
_DIVIDED = 20  # short intervals in a long one


@dataclass(frozen=True, slots=True)
class ConstraintBound:
    """Largest g of one row."""

    constraint: Constraint  # the constraint
    row: int  # index of its row
    bound: float  # largest g over all t; inf where it is not a number
    time: float  # its time, s; to one interval
    is_proven: bool  # the bound is a theorem, not a measured second derivative
    intervals: int  # number of intervals that were evaluated


class Peaks:
    """Largest bounds of a constraint so far, and the number of intervals that were evaluated."""

    def __init__(self, constraint: Braking | TimedConstraint, is_proven: bool) -> None:
        self.constraint, self.is_proven, self.intervals = constraint, is_proven, 0
        self._best, self._time = np.full((2, len(constraint.labels)), -np.inf)

    def see(self, bounds: Array, times: Array) -> None:
        """Take in bounds."""
        if not len(bounds):
            return
        rows = np.ascontiguousarray(bounds.T)
        np.copyto(rows, np.inf, where=np.isnan(rows))
        where = rows.argmax(axis=1)
        best = rows[np.arange(len(rows)), where]
        self._time = np.where(best > self._best, times[where], self._time)
        self._best = np.maximum(best, self._best)

    def bounds(self) -> list[ConstraintBound]:
        """One bound per row."""
        return [
            ConstraintBound(
                self.constraint, row, float(best), float(time), self.is_proven, self.intervals
            )
            for row, (best, time) in enumerate(zip(self._best, self._time, strict=True))
        ]


class MotionGrid:
    """A motion on a grid of `count` intervals; `sup` bounds its derivatives, (6, n)."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory, a = trajectory, trajectory.coefficients
        basis, duration = trajectory.basis, trajectory.duration
        count = max(LEAST_INTERVALS, int(np.ceil(duration / STEP)))
        self.count = count + count % 2
        self.step = duration / self.count
        powers = duration ** -np.arange(ORDERS + 1.0)
        bounds = np.array([basis.bound(k, a.shape[1]) for k in range(ORDERS + 1)])
        self.sup = bounds @ np.abs(a).T * powers[:, None]
        self._weights = a.T * powers[:-1, None, None]

    def between(self, first: int, last: int) -> Array:
        """States q and derivatives at neighbouring samples."""
        basis, size = self._trajectory.basis, self._weights.shape[1]
        return self._moved(_phi(basis, size, first, last, self.count))

    def at(self, samples: Indices, parts: int = 1) -> Array:
        """States q and derivatives, (5, N, n), at any instants."""
        s = samples / (self.count * parts)
        return self._moved(self._trajectory.basis.derivatives(ORDERS, self._weights.shape[1], s))

    def suprema(self, first: Array, last: Array, step: float) -> Array:
        """Bounds (6, K, n) on intervals: the larger end, and half a step of the next derivative."""
        bounds = np.empty((ORDERS + 1, *first.shape[1:]))
        np.maximum(np.abs(first), np.abs(last), out=bounds[:ORDERS])
        bounds[ORDERS] = self.sup[ORDERS]
        for order in reversed(range(ORDERS)):
            bounds[order] += step / 2 * bounds[order + 1] + ROUNDING * self.sup[order]
        # A long interval of a fast motion: no derivative exceeds its bound over all t.
        np.minimum(bounds[1:], self.sup[1:, None], out=bounds[1:])
        return bounds

    def _moved(self, phi: Array) -> Array:
        motion = phi @ self._weights
        motion[0] += self._trajectory.home
        return motion


@lru_cache(maxsize=24)
def _phi(basis: Basis, size: int, first: int, last: int, count: int) -> Array:
    """Derivatives d^k φ_m/ds^k at neighbouring samples, shared by motions of this duration."""
    return basis.derivatives(ORDERS, size, np.arange(first, last + 1) / count)


def constraint_bounds(
    lib: Library, constraints: Sequence[Braking | TimedConstraint], trajectory: Trajectory
) -> tuple[ConstraintBound, ...]:
    """Bounds of the rows of all constraints; of a motion that is its own mirror image, half."""
    grid = MotionGrid(trajectory)
    peaks = [Peaks(constraint, _is_proven(lib, constraint)) for constraint in constraints]
    mirrored = trajectory.basis.is_symmetric
    middle = grid.count // 2 if mirrored else grid.count
    half = [peak for peak in peaks if mirrored and peak.constraint.even]
    whole = [peak for peak in peaks if peak not in half]
    with np.errstate(all="ignore"):  # what is not a number becomes an infinite bound
        for part, end in ((half, middle), (whole, grid.count)):
            see_proven([peak for peak in part if peak.is_proven], lib, grid, end)
            _see_measured([peak for peak in part if not peak.is_proven], lib, grid, end)
        for peak in peaks:
            if isinstance(peak.constraint, Braking):
                _see_braking(peak, peak.constraint, grid, middle, forwards=True)
                if mirrored:
                    _see_braking(peak, peak.constraint, grid, middle, forwards=False)
    return tuple(bound for peak in peaks for bound in peak.bounds())


def _is_proven(lib: Library, constraint: Braking | TimedConstraint) -> bool:
    """Whether the rise of a constraint is bounded by a theorem."""
    if isinstance(constraint, TorqueLimit) and constraint.springs is not None:
        return False
    return isinstance(constraint, Braking) or lib.bounds_motions


def _see_measured(peaks: list[Peaks], lib: Library, grid: MotionGrid, end: int) -> None:
    """Take in all intervals up to `end`, with a measured second derivative."""
    constraints = [
        (peak, peak.constraint) for peak in peaks if not isinstance(peak.constraint, Braking)
    ]
    for first in range(0, end if constraints else 0, _CHUNK):
        last = min(first + _CHUNK, end)
        # An interval more at both sides: the change of ġ there enters the bound.
        before, after = max(first - 1, 0), min(last + 1, end)
        sampled = SampledMotion(lib, grid.between(before, after))
        inner, intervals = slice(first - before, last - before), np.arange(first, last)
        for peak, constraint in constraints:
            # |Δġ| of every interval, then the largest of it and both neighbours.
            g, slope = constraint.along(sampled)
            change = np.abs(np.diff(slope, axis=0))
            bounds = change.copy()
            np.maximum(bounds[1:], change[:-1], out=bounds[1:])
            np.maximum(bounds[:-1], change[1:], out=bounds[:-1])
            # δ²/8 sup g'' with sup g'' = SAFETY · change / δ, above the larger end.
            bounds *= SAFETY * grid.step / 8
            bounds += np.maximum(g[1:], g[:-1])
            peak.see(bounds[inner], grid.step * (intervals.astype(float) + 0.5))
            peak.intervals += last - first


def _see_braking(
    peak: Peaks, constraint: Braking, grid: MotionGrid, end: int, forwards: bool
) -> None:
    """Take in the intervals up to `end` that may hold the largest bounds, chosen by long ones."""
    # Backwards in time odd derivatives change sign.
    turned = np.ones(ORDERS) if forwards else (-1.0) ** np.arange(ORDERS)
    turned = turned[:, None, None]
    ends = np.append(np.arange(0, end, _DIVIDED), end)
    step = grid.step
    long = turned * grid.at(ends)
    # Long intervals: the bound of any short interval inside one is below this, because the chord
    # of the long one and that of the short one are both counted.
    sizes = (1 + _DIVIDED**2) * step**2 / 8, (1 + _DIVIDED) * step / 2
    bounds = _of_braking(constraint, long, grid.sup, *sizes)
    chosen = (bounds > constraint.values(long).max(axis=0)).any(axis=1)
    chosen[np.argmax(bounds, axis=0)] = True  # the first NaN
    # Only long intervals whose bound exceeds the largest value are divided.
    points = np.minimum(ends[:-1][chosen][:, None] + np.arange(_DIVIDED + 1), end)
    short = turned * grid.at(points.ravel())
    bounds = _of_braking(constraint, short, grid.sup, step**2 / 8, step / 2)
    inner = np.arange(len(bounds)) % (_DIVIDED + 1) < _DIVIDED
    intervals = points.ravel()[:-1][inner]
    where = intervals if forwards else grid.count - 1 - intervals
    peak.see(bounds[inner], step * (where.astype(float) + 0.5))
    peak.intervals += len(where)


def _of_braking(
    constraint: Braking, motion: Array, sup: Array, half_square: float, half: float
) -> Array:
    """Proven bounds of g between neighbours and per row, with δ²/8 and δ/2."""
    g = constraint.values(motion)
    ends = np.abs(motion)
    # |ddq| and |dddq| on an interval: the larger end plus δ/2 times the next derivative's bound.
    wide = [np.maximum(ends[k, 1:], ends[k, :-1]) + half * sup[k + 1] for k in range(2, 4)]
    acceleration, jerk = wide
    rises = []
    for side in constraint.sides:
        speed = np.maximum(0, side.sign * motion[1] + side.c)
        # max(0, s dq + c) likewise; then h'' of the module's head, scaled like g.
        speed = np.maximum(speed[1:], speed[:-1]) + half * acceleration
        bend = 2 / side.k * (acceleration**2 + speed * jerk) + acceleration
        rounding = ROUNDING * (sup[0] + 2 / side.k * (sup[1] + side.c) * sup[1])
        rises.append((half_square * bend + rounding) / constraint.room(side))
    return np.asarray(np.maximum(g[1:], g[:-1]) + np.concatenate(rises, axis=1))


class Division:
    """Bounds of one constraint on intervals, and those intervals that must be divided."""

    def __init__(self, peaks: Peaks, constraint: TimedConstraint) -> None:
        """Nothing is seen yet."""
        self.peaks, self.constraint = peaks, constraint
        self._largest = np.full(len(constraint.labels), -np.inf)
        self._kept: list[tuple[Indices, Array]] = []

    def see(self, first: Array, last: Array, rise: Array, intervals: Indices) -> None:
        """Keep bounds of intervals until `settle`."""
        ends = np.maximum(first, last)
        self._largest = np.fmax(self._largest, ends.max(axis=0))
        self._kept.append((intervals, ends + rise))
        self.peaks.intervals += len(intervals)

    def undecided(self, step: float) -> Indices:
        """Hand all bounds that are tight to the peaks."""
        if not self._kept:
            return np.zeros(0, dtype=np.intp)
        intervals = np.concatenate([kept[0] for kept in self._kept])
        bounds = np.concatenate([kept[1] for kept in self._kept])
        self._kept = []
        least, most = self.constraint.precision
        tolerance = np.clip(SHARE * np.abs(self._largest), least, most)
        # What is not a number is not divided: its bound is infinite.
        loose = ((bounds > self._largest + tolerance) & np.isfinite(bounds)).any(axis=1)
        if self.peaks.intervals > MOST_INTERVALS:
            loose[:] = False
        self.peaks.see(bounds[~loose], (intervals[~loose] + 0.5) * step)
        return intervals[loose]


def see_proven(peaks: list[Peaks], lib: Library, grid: MotionGrid, end: int) -> None:
    """Take in proven bounds of all intervals of the grid up to one."""
    divisions = [
        Division(peak, constraint)
        for peak in peaks
        if not isinstance(constraint := peak.constraint, Braking)
    ]
    for first, last in _chunks(end if divisions else 0, _CHUNK):
        motion = grid.between(first, last)
        sup = grid.suprema(motion[:, :-1], motion[:, 1:], grid.step)
        bounds = IntervalBounds(lib, sup, grid.step)
        for each in divisions:
            g = each.constraint.values(motion[:4])
            each.see(g[:-1], g[1:], each.constraint.rise(bounds), np.arange(first, last))
    for each in divisions:
        _divide(each, lib, grid)


def _divide(division: Division, lib: Library, grid: MotionGrid) -> None:
    """Divide intervals until all bounds of a constraint are tight."""
    constraint, parts = division.constraint, 1
    intervals = division.undecided(grid.step)
    while len(intervals):
        parts *= PARTS
        step = grid.step / parts
        for first, last in _chunks(len(intervals), _CHUNK // PARTS):
            inner = PARTS * intervals[first:last, None] + np.arange(PARTS + 1)  # (K, 5) ends
            motion = grid.at(inner.ravel(), parts)
            g = constraint.values(motion[:4])
            # Ends of different intervals do not follow each other.
            begins = np.arange(inner.size).reshape(inner.shape)[:, :-1].ravel()
            sup = grid.suprema(motion[:, begins], motion[:, begins + 1], step)
            rise = constraint.rise(IntervalBounds(lib, sup, step))
            division.see(g[begins], g[begins + 1], rise, inner[:, :-1].ravel())
        intervals = division.undecided(step)


def _chunks(count: int, size: int) -> Iterator[tuple[int, int]]:
    for first in range(0, count, size):
        yield first, min(first + size, count)
