"""Proven bounds over all t of limits that are not linear in the motion, by divided intervals.

On an interval g lies below its larger end by a proven `rise` at most: δ²/8 sup |g''| of torques,
torque rates and the tip, δ/2 sup |g'| of distances. Intervals whose bound exceeds the largest value
at an end by more than a tolerance are divided. The tolerance of a row is a share of its margin.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.limits.interval_bounds import IntervalBounds
from runtime.excitation.limits.nonlinear_limits import Braking, TimedConstraint
from runtime.excitation.proof.motion_grid import MotionGrid
from runtime.excitation.proof.peaks import Peaks
from runtime.library import Array, Library

SHARE = 0.01
"""Tolerance of a bound as a share of the margin of its row."""
PARTS = 4
"""Parts of an interval that is divided."""
MOST_INTERVALS = 1_000_000
"""Of one constraint; what is not decided by then keeps its bound, which is proven but not tight."""
_CHUNK = 2048
"""Intervals at once: their Jacobians stay in the cache."""


class Division:
    """Bounds of one constraint on intervals, and those intervals that must be divided."""

    def __init__(self, peaks: Peaks, constraint: TimedConstraint) -> None:
        """Nothing is seen yet."""
        self.peaks, self.constraint = peaks, constraint
        self._largest = np.full(len(constraint.labels), -np.inf)
        self._kept: list[tuple[NDArray[np.intp], Array]] = []

    def see(self, first: Array, last: Array, rise: Array, intervals: NDArray[np.intp]) -> None:
        """Keep bounds of intervals until `settle`."""
        ends = np.maximum(first, last)
        self._largest = np.fmax(self._largest, ends.max(axis=0))
        self._kept.append((intervals, ends + rise))
        self.peaks.intervals += len(intervals)

    def undecided(self, step: float) -> NDArray[np.intp]:
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
        bounds = IntervalBounds(
            lib, grid.suprema(motion[:, :-1], motion[:, 1:], grid.step), grid.step
        )
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
