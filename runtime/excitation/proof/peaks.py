"""Largest bounds of the rows of one constraint over the intervals of a motion."""

from dataclasses import dataclass

import numpy as np

from runtime.excitation.limits.nonlinear_limits import Braking, Constraint, TimedConstraint
from runtime.library import Array


@dataclass(frozen=True, slots=True)
class ConstraintBound:
    """Largest g of one row.

    Attributes:
        constraint: the constraint.
        row: index of its row.
        bound: largest g over all t; inf where it is not a number.
        time: its time, s; to one interval.
        is_proven: the bound is a theorem, not a measured second derivative.
        intervals: number of intervals that were evaluated.
    """

    constraint: Constraint
    row: int
    bound: float
    time: float
    is_proven: bool
    intervals: int


class Peaks:
    """Largest bounds of a constraint so far.

    Attributes:
        constraint: the constraint.
        is_proven: the bounds are proven.
        intervals: number of intervals that were evaluated.
    """

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
