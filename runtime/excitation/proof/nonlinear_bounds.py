"""Bounds over all t of limits that are not linear in the motion.

On an interval of length δ ≤ 1 ms between two samples g ≤ max(g_k, g_k+1) + δ²/8 sup g''.

- braking: PROVEN. h = max(0, s dq + c)²/k + s q has h'' ≤ 2 (ddq² + max(0, s dq + c) |dddq|)/k
  + |ddq|, and each factor is bounded on the interval by its ends and the next derivative.
- torque, torque rate, tip box and speed, self-collision, table: PROVEN by `division`, where the
  robot has kernels of bounds.
- position and velocity of joints that follow several others: PROVEN by `division`, as linear
  combinations of the motion; of joints that a closed loop moves: MEASURED.
- the same limits of robots with closed loops, and torque and torque rate of robots with springs of
  known stiffness or torque curves: MEASURED, not proven. ġ is exact at every sample (by kernels
  along the motion's derivatives, of springs by differences); g'' on an interval is taken
  as `SAFETY` times the largest change of ġ over δ there and on both neighbouring intervals. The
  fastest wave of a motion, M / t_f, has hundreds of samples per period, so that neighbours suffice.
  Where the closest points of two links jump, ġ jumps too and the bound grows, never shrinks.
"""

from collections.abc import Sequence

import numpy as np

from runtime.excitation import Trajectory
from runtime.excitation.limits.dependent_joints import DependentPosition, DependentVelocity
from runtime.excitation.limits.nonlinear_limits import Braking, TimedConstraint
from runtime.excitation.limits.sampled_motion import SampledMotion
from runtime.excitation.limits.torque_limits import Torque, TorqueRate
from runtime.excitation.proof.division import see_proven
from runtime.excitation.proof.motion_grid import ORDERS, ROUNDING, MotionGrid
from runtime.excitation.proof.peaks import ConstraintBound, Peaks
from runtime.library import Array, Library

SAFETY = 2.0
_CHUNK = 2048
"""Intervals at once: their Jacobians stay in the cache."""
_DIVIDED = 20
"""Short intervals in a long one."""


def constraint_bounds(
    lib: Library, constraints: Sequence[Braking | TimedConstraint], trajectory: Trajectory
) -> tuple[ConstraintBound, ...]:
    """Bounds of the rows of all constraints.

    Half of a motion is evaluated where it is its own mirror image, for braking in both directions.
    """
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
    if isinstance(constraint, Torque | TorqueRate) and constraint.springs is not None:
        return False
    if isinstance(constraint, DependentPosition | DependentVelocity):
        return not lib.manifest.loops
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
