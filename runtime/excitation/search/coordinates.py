"""Motions as points x of one vector, in which the optimisers work: vec(a) = S x.

S whitens the limits of the joints, scaled so that a point of size one reaches a bound. Values are
computed from the coefficients a; slopes are carried back, ∂f/∂x = Sᵀ ∂f/∂vec(a). A descent begins
at a random point, or near a good one (`varied`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.excitation.limits.limit_rows import LimitRows
from runtime.excitation.search.condition_cost import ConditionCost
from runtime.library import Array

NOISE = 0.2, 0.8
"""Smallest and largest noise on all coordinates of a variation; 1 reaches the bounds."""
FAR_NOISE = 0.45, 0.75
"""The same far from a parent: with less, most descents of a smooth criterion return to it; with
more, most are given up. Between 0.5 and 0.7 they gained twice as much as between 0.7 and 0.9."""
FAVOUR = 0.25
"""Probability that the best parent is chosen; the next ones follow a geometric law."""
FAR_FAVOUR = 0.35
"""The same where a smooth criterion decides."""


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The map from x to coefficients."""

    spread: Array  # S, (n M, p)
    shape: tuple[int, int]  # n, M

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


def varied(
    rng: np.random.Generator,
    known: Array,
    number: int,
    joints: int,
    drawn: Callable[[np.random.Generator], Array],
) -> Array:
    """Return a parent with noise on all coordinates, or with new motions of one or two joints.

    known (K, p), drawn (p,) → (p,).
    """
    x = _parent(rng, known, FAVOUR)
    if number % 3 == 2:
        return np.asarray(x + rng.uniform(*NOISE) * rng.normal(size=len(x)))
    chosen = _chosen(rng, joints, 1 + number % 3, len(x))
    return np.where(chosen, drawn(rng), x)


def varied_far(rng: np.random.Generator, known: Array, number: int, joints: int) -> Array:
    """Return a parent with much noise, or with the mirrored motion of one joint.

    Seven of eight variations have noise on all coordinates, which leads to a better optimum twice
    as often as new motions of two joints. A mirrored motion keeps the amplitudes of its joint.

    known (K, p) → (p,).
    """
    x = _parent(rng, known, FAR_FAVOUR)
    if number % 8 == 4:
        return np.where(_chosen(rng, joints, 1, len(x)), -x, x)
    return np.asarray(x + rng.uniform(*FAR_NOISE) * rng.normal(size=len(x)))


def _parent(rng: np.random.Generator, known: Array, favour: float) -> Array:
    return np.asarray(known[min(int(rng.geometric(favour)), len(known)) - 1])


def _chosen(rng: np.random.Generator, joints: int, count: int, size: int) -> Array:
    """Coordinates (size,) of so many random joints."""
    chosen = rng.permutation(joints)[:count]
    return np.repeat(np.isin(np.arange(joints), chosen), size // joints)
