"""Motions as points x of one vector, in which the optimisers work: vec(a) = S x.

S whitens the limits of the joints, scaled so that a point of size one reaches a bound. Values are
computed from the coefficients a; slopes are carried back, ∂f/∂x = Sᵀ ∂f/∂vec(a).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.limits.limit_rows import LimitRows
from runtime.excitation.search.condition_cost import ConditionCost
from runtime.library import Array


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The map from x to coefficients.

    Attributes:
        spread: S, (n M, p).
        shape: n, M.
    """

    spread: Array
    shape: tuple[int, int]

    def coefficients(self, points: Array) -> Array:
        """Coefficients a of K points x, (K, n, M)."""
        return (points @ self.spread.T).reshape(-1, *self.shape)

    def of_one(self, x: Array) -> Array:
        """Coefficients a of one point x, (n, M)."""
        return self.coefficients(x[None])[0]

    def points(self, coefficients: Array) -> Array:
        """Points x (K, p) of coefficients a (K, n, M)."""
        flat = np.reshape(coefficients, (len(coefficients), -1))
        return np.asarray(np.linalg.solve(self.spread, flat.T).T)

    def slopes(self, gradients: Array) -> Array:
        """Slopes ∂/∂x (K, p) from ∂/∂a (K, n, M)."""
        return gradients.reshape(-1, len(self.spread)) @ self.spread


class ElasticLimits:
    """Limits that are not linear, as functions of x."""

    def __init__(self, coordinates: Coordinates, rows: LimitRows) -> None:
        self._coordinates, self._rows = coordinates, rows

    def violation(self, x: Array) -> float:
        """Largest value above zero."""
        return max(0.0, self._rows.worst(self._coordinates.of_one(x)))

    def near(self, x: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Numbers, values and slopes of all rows that a step could violate."""
        numbers, values, slopes = self._rows.linearised(self._coordinates.of_one(x))
        return numbers, values, self._coordinates.slopes(slopes)

    def values(self, x: Array, numbers: NDArray[np.intp]) -> Array:
        """Values of chosen rows.

        x (p,), numbers (m,) → (m,).
        """
        return self._rows.values(self._coordinates.of_one(x))[numbers]

    def jacobian(self, x: Array, numbers: NDArray[np.intp]) -> Array:
        """Slopes of chosen rows.

        x (p,), numbers (m,) → (m, p).
        """
        rows = self._rows.jacobian(self._coordinates.of_one(x), numbers)
        return self._coordinates.slopes(rows)


class Correlations:
    """Matrix C of the base regressor as a function of x."""

    def __init__(self, coordinates: Coordinates, cost: ConditionCost) -> None:
        self._coordinates, self._cost = coordinates, cost

    def at(self, points: Array) -> Array:
        """Matrices C of K points, (K, n_b, n_b)."""
        return self._cost.correlations(self._coordinates.coefficients(points))

    def slopes(self, points: Array, weight: Array) -> tuple[Array, Array]:
        """Matrices and slopes for a constant symmetric F.

        points (K, p), weight (n_b, n_b) → (K, n_b, n_b).
        """
        a = self._coordinates.coefficients(points)
        matrices, gradients = self._cost.correlations_slopes(a, weight)
        return matrices, self._coordinates.slopes(gradients)
