"""Convex programmes with a few variables and many rows, by Clarabel."""

from collections.abc import Callable
from dataclasses import dataclass

import clarabel
import numpy as np
from scipy import sparse

from runtime.library import Array

TOLERANCE = 1e-9
"""Of the programmes: relative gap and feasibility."""
SLACK = 1e-6
"""Relative: by how much a row may be violated; without it, a row at its bound would stop all."""
_ROUNDS = 30
"""Of adding rows; after that the step is shortened instead."""


@dataclass(frozen=True, slots=True)
class Block:
    """Rows b − A x ∈ cone: the nonnegative numbers, or triangles of psd matrices of `order`."""

    a: Array
    b: Array
    order: int | None = None


def solve(quadratic: Array, linear: Array, blocks: list[Block]) -> tuple[Array, list[Array]] | None:
    """min ½ xᵀP x + qᵀx over the blocks: x and the duals block by block; None where it failed."""
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
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(quadratic)),
        linear,
        sparse.csc_matrix(np.vstack([block.a for block in blocks])),
        np.concatenate([block.b for block in blocks]),
        cones,
        settings,
    ).solve()
    x = np.array(solution.x)
    if str(solution.status) not in {"Solved", "AlmostSolved"} or not np.isfinite(x).all():
        return None
    ends = np.cumsum([len(block.b) for block in blocks])[:-1]
    return x, np.split(np.array(solution.z), ends)


class LinearRows:
    """A x ≤ b with far more rows than ever matter: each is used from when it is first violated.

    Rows that are neighbours on a grid stand next to each other.
    """

    def __init__(self, matrix: Array, bound: Array) -> None:
        self.matrix, self.bound = matrix, bound
        self._used = np.zeros(len(matrix), dtype=bool)
        self._used[matrix.argmax(axis=0)] = self._used[matrix.argmin(axis=0)] = True

    @property
    def used(self) -> int:
        """How many rows have been looked at."""
        return int(self._used.sum())

    def slack(self, x: Array) -> Array:
        """B − A x, not below zero."""
        return np.maximum(self.bound - self.matrix @ x, 0.0)

    def reach(self, x: Array, step: Array) -> float:
        """Largest t ≤ 1 with A (x + t step) ≤ b, to `SLACK`."""
        speed = self.matrix @ step
        slack = np.maximum(self.bound * (1 + SLACK) - self.matrix @ x, 0.0)
        towards = speed > 0
        return float(min(1.0, (slack[towards] / speed[towards]).min(initial=1.0)))

    def solve(
        self,
        x: Array,
        programme: Callable[[Array, Array], tuple[Array, list[Array]] | None],
        more: Callable[[Array], bool] | None = None,
    ) -> tuple[Array, list[Array]] | None:
        """The solution of `programme(rows, slack)` for a step from x that keeps all rows.

        The step is the first part of the programme's variables; `more(step)` says whether rows of
        another kind have joined the programme meanwhile.
        """
        slack, found = self.slack(x), None
        for _ in range(_ROUNDS):
            found = programme(self.matrix[self._used], slack[self._used])
            if found is None:
                return None
            step = found[0][: len(x)]
            excess = self.matrix @ step - slack
            peak = np.pad(excess, 1, constant_values=-np.inf)
            peaks = (excess >= peak[:-2]) & (excess >= peak[2:])
            new = peaks & (excess > SLACK / 10 * self.bound) & ~self._used
            self._used |= new
            joined = more is not None and more(step)
            if not new.any() and not joined:
                break
        return found
