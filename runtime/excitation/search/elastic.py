"""Nonlinear constraints g(x) ≤ 0 in programmes for a step: linearised, elastic, exact penalty.

With v(x) = max(0, max g) the merit of x is f + μ v, and a step d may leave g + J d ≤ t at the
price μ t. Above the sum of the multipliers of the rows, μ makes minima of the merit admissible
(Fletcher 1987, Sec. 12.3). Independent of robots.
"""

from copy import copy
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.search.conic import SLACK, Block
from runtime.library import Array

MU = 20.0
"""Penalty μ: f is log cond or like it, x has size one at the bounds; multipliers stay below 5."""
_FIRST = -0.02
"""Peaks above this value are used in the first programme of a step."""
_CORRECTED = 400
"""Most rows of a correction: more are no small violation."""


class Nonlinear(Protocol):
    """Many smooth rows g(x) ≤ 0, those of a grid next to each other."""

    def violation(self, x: Array) -> float:
        """Violation v(x) = max(0, max g)."""

    def near(self, x: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Numbers, ascending, g (m,) and J (m, p) of all rows that a step could violate."""

    def values(self, x: Array, numbers: NDArray[np.intp]) -> Array:
        """Values of chosen rows.

        Args:
            x: point, (p,).
            numbers: of the rows, ascending, (m,).

        Returns:
            g, (m,).
        """

    def jacobian(self, x: Array, numbers: NDArray[np.intp]) -> Array:
        """Slopes of chosen rows.

        Args:
            x: point, (p,).
            numbers: of the rows, ascending, (m,).

        Returns:
            J, (m, p).
        """


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

    def block(self, variables: int) -> Block:
        """Rows g + J d ≤ t and t ≥ 0, with t the last of the variables."""
        g, slopes = self._values[self._used], self._slopes[self._used]
        a = np.zeros((len(g) + 1, variables))
        a[:-1, : self._slopes.shape[1]] = slopes
        a[:, -1] = -1.0
        return Block(a, np.append(-g, 0.0))

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
        """Change of the rows' slopes, weighted by their multipliers: Σ λ (J(after) − J).

        after (p,) → (p,).
        """
        lam = duals[:-1]
        active = lam > SLACK
        rows = np.flatnonzero(self._used)[active]
        change = self._nonlinear.jacobian(after, self._numbers[rows]) - self._slopes[rows]
        return np.asarray(lam[active] @ change)

    def _peaks(self, values: Array) -> NDArray[np.bool_]:
        """Rows not below their direct neighbours on the grid."""
        # A missing number is a gap: neighbours in the array are then no neighbours on the grid.
        joined = np.diff(self._numbers) == 1
        falls = np.diff(values) <= 0
        rises = np.diff(values) >= 0
        not_left = np.append(True, rises | ~joined)
        not_right = np.append(falls | ~joined, True)
        return (not_left & not_right)[: len(values)]


def corrected(nonlinear: Nonlinear, x: Array) -> Array | None:
    """Shortest step that ends the violations, to first order.

    A full step along linearised rows violates by its square; without this correction the merit
    would reject it near the optimum (Maratos 1978).

    x (p,) → (p,).
    """
    numbers, values, slopes = nonlinear.near(x)
    violated = values > 0
    if not 0 < violated.sum() <= _CORRECTED:
        return None
    del numbers
    slopes, values = slopes[violated], values[violated]
    # Least norm: d = −Jᵀ (J Jᵀ)⁻¹ g. Neighbouring rows are nearly parallel, hence the 1e-8.
    gram = slopes @ slopes.T
    gram[np.diag_indices_from(gram)] += 1e-8 * np.trace(gram) / len(gram)
    return np.asarray(-slopes.T @ np.linalg.solve(gram, values))
