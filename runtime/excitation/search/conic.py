"""Convex programmes with a few variables and many rows, by Clarabel."""

from collections.abc import Callable
from dataclasses import dataclass

import clarabel
import numpy as np
from numpy.typing import NDArray

from runtime.library import Array

TOLERANCE = 1e-9
"""Tolerance of the programmes: relative gap and feasibility."""
SLACK = 1e-6
"""Relative violation of a row that is allowed; without it a row at its bound stops every step."""
_ROUNDS = 30
"""Rounds of adding rows; after that the step is shortened instead."""


@dataclass(frozen=True, slots=True)
class Block:
    """Rows b − A x ∈ cone: the nonnegative numbers, or triangles of psd matrices of `order`."""

    a: Array
    b: Array
    order: int | None = None


def solve(quadratic: Array, linear: Array, blocks: list[Block]) -> tuple[Array, list[Array]] | None:
    """Solve min ½ xᵀP x + qᵀx over the blocks.

    quadratic (p, p), linear (p,) → (p,).
    """
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "qdldl"  # one thread: the same bits everywhere
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
    settings.max_iter = 60
    cones = [
        clarabel.NonnegativeConeT(len(block.b))
        if block.order is None
        else clarabel.PSDTriangleConeT(block.order)
        for block in blocks
    ]
    solved = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(quadratic)),
        linear,
        sparse.csc_matrix(np.vstack([block.a for block in blocks])),
        np.concatenate([block.b for block in blocks]),
        cones,
        settings,
    ).solve()
    x = np.array(solved.x)
    if str(solved.status) not in {"Solved", "AlmostSolved"} or not np.isfinite(x).all():
        return None
    ends = np.cumsum([len(block.b) for block in blocks])[:-1]
    return x, np.split(np.array(solved.z), ends)


class LinearRows:
    """Rows A x ≤ b, far more than are ever active: a row is used from its first violation on.

    Rows that are neighbours on a grid stand next to each other.
    """

    def __init__(self, matrix: Array, bound: Array) -> None:
        self.matrix, self.bound = matrix, bound
        self._used = np.zeros(len(matrix), dtype=bool)
        self._used[matrix.argmax(axis=0)] = self._used[matrix.argmin(axis=0)] = True
        self._parts = _parts(matrix)

    def times(self, x: Array) -> Array:
        """Products A x, (m,)."""
        product = np.empty(len(self.matrix))
        for rows, columns, part in self._parts:
            product[rows] = part @ x[columns]
        return product

    @property
    def used(self) -> int:
        """Number of rows that have been used."""
        return int(self._used.sum())

    def slack(self, x: Array) -> Array:
        """Distances b − A x, not below zero."""
        return np.maximum(self.bound - self.times(x), 0.0)

    def reach(self, x: Array, step: Array) -> float:
        """Largest t ≤ 1 with A (x + t step) ≤ b, to `SLACK`."""
        speed = self.times(step)
        slack = np.maximum(self.bound * (1 + SLACK) - self.times(x), 0.0)
        towards = speed > 0
        return float(min(1.0, (slack[towards] / speed[towards]).min(initial=1.0)))

    def solve(
        self,
        x: Array,
        programme: Callable[[Array, Array], tuple[Array, list[Array]] | None],
        more: Callable[[Array], bool] | None = None,
    ) -> tuple[Array, list[Array]] | None:
        """Solve a programme for a step from x that keeps all rows."""
        slack, solution = self.slack(x), None
        for _ in range(_ROUNDS):
            solution = programme(self.matrix[self._used], slack[self._used])
            if solution is None:
                return None
            step = solution[0][: len(x)]
            # Of every stretch of violated neighbours only the peak is added: the others follow it.
            excess = self.times(step) - slack
            peak = np.pad(excess, 1, constant_values=-np.inf)
            peaks = (excess >= peak[:-2]) & (excess >= peak[2:])
            new = peaks & (excess > SLACK / 10 * self.bound) & ~self._used
            self._used |= new
            joined = more is not None and more(step)
            if not new.any() and not joined:
                break
        return solution


def _parts(matrix: Array) -> list[tuple[NDArray[np.intp], NDArray[np.intp], Array]]:
    """Rows with entries in the same columns, these columns, and the entries: joints in turn."""
    groups: dict[bytes, list[int]] = {}
    for number, pattern in enumerate(np.packbits(matrix != 0, axis=1)):
        groups.setdefault(pattern.tobytes(), []).append(number)
    if len(groups) > matrix.shape[1]:  # rows of many patterns cost less in one product
        return [(np.arange(len(matrix)), np.arange(matrix.shape[1]), matrix)]
    parts = []
    for numbers in groups.values():
        rows, columns = np.array(numbers), np.flatnonzero(matrix[numbers[0]])
        parts.append((rows, columns, np.ascontiguousarray(matrix[np.ix_(rows, columns)])))
    return parts
