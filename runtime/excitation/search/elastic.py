"""Nonlinear constraints g(x) ≤ 0 in programmes for a step: linearised, elastic, exact penalty.

With v(x) = max(0, max g) the merit of x is f + μ v, and a step d may leave g + J d ≤ t at the
price μ t. Above the sum of the rows' multipliers μ makes minima of the merit admissible (Fletcher
1987, Sec. 12.3). Knows nothing of robots.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.search.conic import SLACK, Block
from runtime.library import Array

MU = 20.0
"""μ: f is log cond or like it, x has size one at the bounds; multipliers stay below 5."""
_FIRST = -0.02
"""Peaks above are used in the first programme of a step."""
_CORRECTED = 400
"""Most rows of a correction: more are no small violation."""


class Nonlinear(Protocol):
    """Many smooth rows g(x) ≤ 0, those of a grid next to each other."""

    def violation(self, x: Array) -> float:
        """V(x) = max(0, max g)."""

    def near(self, x: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Numbers, ascending, g (m,) and J (m, p) of all rows that a step could violate."""

    def jacobian(self, x: Array, numbers: NDArray[np.intp]) -> Array:
        """J of these rows, (m, p)."""


class Curved:
    """g + J d near x; a row is used from when it is the largest in its neighbourhood."""

    def __init__(self, nonlinear: Nonlinear, x: Array) -> None:
        self._nonlinear = nonlinear
        self._numbers, self._values, self._slopes = nonlinear.near(x)
        self._used = self._peaks(self._values) & (self._values > _FIRST)

    def block(self, variables: int) -> Block:
        """G + J d ≤ t and t ≥ 0, with t the last of the variables."""
        g, slopes = self._values[self._used], self._slopes[self._used]
        a = np.zeros((len(g) + 1, variables))
        a[:-1, : self._slopes.shape[1]] = slopes
        a[:, -1] = -1.0
        return Block(a, np.append(-g, 0.0))

    def after(self, step: Array) -> float:
        """v after the step as the linear model has it."""
        return float((self._values + self._slopes @ step).max(initial=0.0))

    def grow(self, step: Array) -> bool:
        """Use the peaks above all used rows; False where there are none."""
        model = self._values + self._slopes @ step
        level = model[self._used].max(initial=0.0)
        new = self._peaks(model) & (model > level + SLACK) & ~self._used
        self._used |= new
        return bool(new.any())

    def bent(self, duals: Array, after: Array) -> Array:
        """Σ λ (J(after) − J), (p,): what the rows add to a change of the Lagrangian's gradient."""
        lam = duals[:-1]
        felt = lam > SLACK
        rows = np.flatnonzero(self._used)[felt]
        change = self._nonlinear.jacobian(after, self._numbers[rows]) - self._slopes[rows]
        return np.asarray(lam[felt] @ change)

    def _peaks(self, values: Array) -> NDArray[np.bool_]:
        """Not below its direct neighbours on the grid."""
        joined = np.diff(self._numbers) == 1
        falls = np.diff(values) <= 0
        rises = np.diff(values) >= 0
        not_left = np.append(True, rises | ~joined)
        not_right = np.append(falls | ~joined, True)
        return (not_left & not_right)[: len(values)]


def corrected(nonlinear: Nonlinear, x: Array) -> Array | None:
    """The shortest step from x that ends the violations there, to first order.

    A full step along linearised rows violates by its square; without this the merit would reject
    it near the optimum (Maratos 1978).
    """
    numbers, values, slopes = nonlinear.near(x)
    violated = values > 0
    if not 0 < violated.sum() <= _CORRECTED:
        return None
    del numbers
    slopes, values = slopes[violated], values[violated]
    gram = slopes @ slopes.T
    gram[np.diag_indices_from(gram)] += 1e-8 * np.trace(gram) / len(gram)
    return np.asarray(-slopes.T @ np.linalg.solve(gram, values))
