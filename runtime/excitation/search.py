"""One start of the search: a random admissible trajectory, descended to a local optimum.

Normalised D-optimality decides for a basin, Schatten norms lead to the kink of log cond, and the
semidefinite programmes of `polish` end in it.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.excitation.conic import Rows
from runtime.excitation.cost import ConditionCost
from runtime.excitation.criteria import Criterion, d_optimal, schatten
from runtime.excitation.limits import LIMIT_STEP, Limits, inside, whitening
from runtime.excitation.polish import polish
from runtime.excitation.sqp import Objective, descend
from runtime.library import Array, Library, load

START = 0.5
"""Limit use of a random start: far enough inside to choose its own basin."""
STAGES: tuple[tuple[Criterion, int], ...] = (
    (d_optimal, 100),
    (schatten(8.0), 60),
    (schatten(32.0), 60),
)
"""Criteria of the descent in turn, and iterations of each."""
FINE_STEP = 0.01
"""Grid of the limits of the last polish, s: between its points motions overshoot by 1e-5."""
FINE_POINTS = 1000
"""At most, of that grid."""
POLISH = 40
"""Semidefinite programmes at most."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What is searched, small enough to be sent to another process.

    Attributes:
        folder: of the robot.
        level: of its library.
        home: (n,) rad or m.
        harmonics: M.
        duration: t_f, s.
        seed: of all starts.
    """

    folder: Path
    level: str
    home: Array
    harmonics: int
    duration: float
    seed: int

    def search(self) -> "Search":
        """Loads the library of the folder."""
        return Search(load(self.folder, self.level), self)


class Search:
    """Descents from random starts; a start depends on its number and the seed alone."""

    def __init__(self, lib: Library, problem: Problem) -> None:
        shape = (lib, problem.home, problem.harmonics, problem.duration)
        self._grid = shape
        self.cost, self.limits = ConditionCost(*shape), Limits(*shape)
        self._seed, self._shape = problem.seed, (lib.n_joints, problem.harmonics)
        matrix, self._bound = self.limits.inequalities()
        spread = whitening(matrix, lib.n_joints)
        # Of `whitening`'s unit vectors each row sees a share; now x of size one reaches a bound.
        self._spread = spread * np.sqrt(len(matrix) / (3.0 * len(spread)))
        self._matrix = matrix @ self._spread

    def start(self, number: int) -> tuple[float, Array]:
        """Log cond and coefficients (n, M), within the limits of the descent's grid."""
        rng = np.random.default_rng((self._seed, number))
        x = rng.normal(size=len(self._spread))
        x *= START / np.max(self._matrix @ x)
        rows = Rows(self._matrix, self._bound)
        for criterion, iterations in STAGES:
            x = descend(self._objective(criterion), x, rows, iterations).x
        x = polish(_Correlations(self), x, rows, POLISH).x
        a = inside(self.limits, self.coefficients(x[None])[0])
        return self.cost.value_gradient(a)[0], a

    def refined(self, a: Array) -> Array:
        """The same optimum on a finer grid: pulled inside there alone it would lose 0.5 %."""
        step = max(FINE_STEP, self._grid[-1] / 2 / FINE_POINTS)
        fine = Limits(*self._grid, step=min(step, LIMIT_STEP))
        matrix, bound = fine.inequalities()
        x = np.linalg.solve(self._spread, inside(fine, a).ravel())
        x = polish(_Correlations(self), x, Rows(matrix @ self._spread, bound), POLISH).x
        return self.coefficients(x[None])[0]

    def coefficients(self, points: Array) -> Array:
        """A of K points x, (K, n, M)."""
        return (points @ self._spread.T).reshape(-1, *self._shape)

    def slopes(self, gradients: Array) -> Array:
        """∂/∂x from ∂/∂a (K, n, M), (K, p)."""
        return gradients.reshape(len(gradients), -1) @ self._spread

    def _objective(self, criterion: Criterion) -> Objective:
        def objective(x: Array) -> tuple[float, Array]:
            value, gradient = self.cost.criterion(self.coefficients(x[None])[0], criterion)
            return value, self.slopes(gradient[None])[0]

        return objective


class _Correlations:
    """C of the base regressor as a function of x."""

    def __init__(self, search: Search) -> None:
        self._search = search

    def at(self, points: Array) -> Array:
        return self._search.cost.correlations(self._search.coefficients(points))

    def slopes(self, points: Array, weight: Array) -> tuple[Array, Array]:
        a = self._search.coefficients(points)
        matrices, gradients = self._search.cost.correlations_slopes(a, weight)
        return matrices, self._search.slopes(gradients)
