"""Convex programmes with a few variables and many rows, by Clarabel, with elastic rows.

Nonlinear constraints g(x) ≤ 0 are linearised in programmes for a step, with an exact penalty. With
v(x) = max(0, max g) the merit of x is f + μ v, and a step d may leave g + J d ≤ t at the price μ t.
Above the sum of the multipliers of the rows, μ makes minima of the merit admissible (Fletcher 1987,
Sec. 12.3). Independent of robots.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Protocol

import clarabel
import numpy as np
from scipy import sparse

from runtime.library import Array, Indices, Mask

MU = 20.0  # penalty μ: f is like log cond, x has size one at the bounds; multipliers stay below 5
_FIRST = -0.02  # peaks above this value are used in the first programme of a step
_CORRECTED = 400  # most rows of a correction: more are no small violation
TOLERANCE = 1e-9  # tolerance of the programmes: relative gap and feasibility
SLACK = 1e-6  # relative violation of a row; without it a row at its bound stops every step
_ROUNDS = 30  # rounds of adding rows; after that the step is shortened instead


@dataclass(frozen=True, slots=True)
class ConeBlock:
    """Rows b − A x ∈ cone: the nonnegative numbers, or triangles of psd matrices of `order`."""

    a: Array
    b: Array
    order: int | None = None


def solve(
    quadratic: Array, linear: Array, blocks: list[ConeBlock]
) -> tuple[Array, list[Array]] | None:
    """Solve min ½ xᵀP x + qᵀx over the blocks: x and their multipliers; None where it fails."""
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


def _parts(matrix: Array) -> list[tuple[Indices, Indices, Array]]:
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


class Nonlinear(Protocol):
    """Many smooth rows g(x) ≤ 0, those of a grid next to each other.

    Args:
        x: point, (p,).
        numbers: of chosen rows, ascending, (m,).
    """

    def violation(self, x: Array) -> float:
        """Violation v(x) = max(0, max g)."""

    def near(self, x: Array) -> tuple[Indices, Array, Array]:
        """Numbers, ascending, g (m,) and J (m, p) of all rows that a step could violate."""

    def values(self, x: Array, numbers: Indices) -> Array:
        """Values g, (m,), of chosen rows."""

    def jacobian(self, x: Array, numbers: Indices) -> Array:
        """Slopes J, (m, p), of chosen rows."""


class Curved:
    """Linear model g + J d near x; a row is used from when it is the largest of its neighbours."""

    def __init__(self, nonlinear: Nonlinear, x: Array) -> None:
        self._nonlinear, self._x = nonlinear, x
        self._numbers, self._values, self._slopes = nonlinear.near(x)
        self._used = self._peaks(self._values) & (self._values > _FIRST)

    def corrected(self, step: Array) -> "Curved":
        """Model with the slopes here that is exact after the step: g(x + s) + J (d − s).

        The step that solves the same programme with it keeps rows that bend away from their
        tangents to third order (second-order correction, Fletcher 1987, Sec. 12.4).
        """
        after = self._nonlinear.values(self._x + step, self._numbers)
        bent = copy(self)
        bent._values = after - self._slopes @ step
        bent._used = self._used | (self._peaks(after) & (after > _FIRST))
        return bent

    def block(self, variables: int) -> ConeBlock:
        """Rows g + J d ≤ t and t ≥ 0, with t the last of the variables."""
        g, slopes = self._values[self._used], self._slopes[self._used]
        a = np.zeros((len(g) + 1, variables))
        a[:-1, : self._slopes.shape[1]] = slopes
        a[:, -1] = -1.0
        return ConeBlock(a, np.append(-g, 0.0))

    def after(self, step: Array) -> float:
        """Violation v after the step by the linear model."""
        return float((self._values + self._slopes @ step).max(initial=0.0))

    def grow(self, step: Array) -> bool:
        """Use the peaks above all used rows; false where there are none."""
        model = self._values + self._slopes @ step
        # Rows below the largest used one cannot raise t.
        level = model[self._used].max(initial=0.0)
        new = self._peaks(model) & (model > level + SLACK) & ~self._used
        self._used |= new
        return bool(new.any())

    def bent(self, duals: Array, after: Array) -> Array:
        """Change of the rows' slopes, weighted by their multipliers: Σ λ (J(after) − J), (p,)."""
        lam = duals[:-1]
        active = lam > SLACK
        rows = np.flatnonzero(self._used)[active]
        change = self._nonlinear.jacobian(after, self._numbers[rows]) - self._slopes[rows]
        return np.asarray(lam[active] @ change)

    def _peaks(self, values: Array) -> Mask:
        """Rows not below their direct neighbours on the grid."""
        # A missing number is a gap: neighbours in the array are then no neighbours on the grid.
        joined = np.diff(self._numbers) == 1
        falls = np.diff(values) <= 0
        rises = np.diff(values) >= 0
        not_left = np.append(True, rises | ~joined)
        not_right = np.append(falls | ~joined, True)
        return (not_left & not_right)[: len(values)]


def corrected(nonlinear: Nonlinear, x: Array) -> Array | None:
    """Shortest step (p,) that ends the violations, to first order.

    A full step along linearised rows violates by its square; without this correction the merit
    would reject it near the optimum (Maratos 1978).
    """
    _, values, slopes = nonlinear.near(x)
    violated = values > 0
    if not 0 < violated.sum() <= _CORRECTED:
        return None
    slopes, values = slopes[violated], values[violated]
    # Least norm: d = −Jᵀ (J Jᵀ)⁻¹ g. Neighbouring rows are nearly parallel, hence the 1e-8.
    gram = slopes @ slopes.T
    gram[np.diag_indices_from(gram)] += 1e-8 * np.trace(gram) / len(gram)
    return np.asarray(-slopes.T @ np.linalg.solve(gram, values))
