"""One start of the search: a random admissible trajectory, descended to a local optimum.

Normalised D-optimality decides for a basin and the goal's measures lead on; where that is log cond
the semidefinite programmes of `polish` end in its kink.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.basis import COSINE, Basis
from runtime.excitation.conic import Rows
from runtime.excitation.cost import ConditionCost
from runtime.excitation.criteria import Measure, rank, too_many
from runtime.excitation.goals import goal
from runtime.excitation.information import Information
from runtime.excitation.limits import LIMIT_STEP, Limits, inside, whitening
from runtime.excitation.polish import polish
from runtime.excitation.sqp import Objective, descend
from runtime.library import Array, Library, load

START = 0.5
"""Limit use of a random start: far enough inside to choose its own basin."""
FINE_STEP = 0.01
"""Grid of the limits of the last polish, s: between its points motions overshoot by 1e-5."""
FINE_POINTS = 1000
"""At most, of that grid."""
POLISH = 40
"""Semidefinite programmes at most, or steps of the last descent of a smooth goal."""


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
        basis: of the motion.
        criterion: of `goals.CRITERIA`.
        information: of the unknowns; None is all base parameters by their regressor alone.
    """

    folder: Path
    level: str
    home: Array
    harmonics: int
    duration: float
    seed: int
    basis: Basis = COSINE
    criterion: str = "cond"
    information: Information | None = None

    def search(self) -> "Search":
        """Loads the library of the folder."""
        return Search(load(self.folder, self.level), self)


class Search:
    """Descents from random starts; a start depends on its number and the seed alone."""

    def __init__(self, lib: Library, problem: Problem) -> None:
        self.basis, size = problem.basis, problem.basis.size(problem.harmonics)
        self.goal = goal(problem.criterion, lib, problem.home, problem.information)
        shape = self._grid = (lib, problem.home, size, problem.duration)
        self.cost = ConditionCost(*shape, self.basis, problem.information)
        self.limits = Limits(*shape, basis=self.basis)
        self._seed, self._shape = problem.seed, (lib.n_joints, size)
        matrix, self._bound = self.limits.inequalities()
        spread = whitening(matrix, lib.n_joints)
        # Of `whitening`'s unit vectors each row sees a share; now x of size one reaches a bound.
        self._spread = spread * np.sqrt(len(matrix) / (3.0 * len(spread)))
        self._matrix = matrix @ self._spread

    def start(self, number: int) -> tuple[float, Array]:
        """The goal's target and coefficients (n, M), within the limits of the descent's grid."""
        x = self._random(number)
        rows = Rows(self._matrix, self._bound)
        for measure, iterations in self.goal.stages:
            x = descend(self._objective(measure), x, rows, iterations).x
        if self.goal.is_kinked:
            x = polish(_Correlations(self), x, rows, POLISH).x
        a = inside(self.limits, self.coefficients(x[None])[0])
        return self.value(a), a

    def require_rank(self) -> None:
        """Random motions tell all unknowns apart.

        Raises:
            IdentificationError: they do not, and no other motion of this basis will.
        """
        gram = self.cost.correlations(self.coefficients(self._random(0)[None]))[0]
        found = rank(gram)
        if found < len(gram):
            raise IdentificationError(too_many(found, len(gram), self._shape[1]))

    def _random(self, number: int) -> Array:
        """A point well inside the limits."""
        rng = np.random.default_rng((self._seed, number))
        x = rng.normal(size=len(self._spread))
        return np.asarray(x * (START / np.max(self._matrix @ x)))

    def value(self, a: Array) -> float:
        """The goal's target."""
        if self.goal.is_kinked:
            return self.cost.value_gradient(a)[0]
        return self.cost.measure(a, self.goal.target)[0]

    def refined(self, a: Array) -> Array:
        """The same optimum on a finer grid: pulled inside there alone it would lose 0.5 %."""
        step = max(FINE_STEP, self._grid[-1] / 2 / FINE_POINTS)
        fine = Limits(*self._grid, step=min(step, LIMIT_STEP), basis=self.basis)
        matrix, bound = fine.inequalities()
        x = np.linalg.solve(self._spread, inside(fine, a).ravel())
        rows = Rows(matrix @ self._spread, bound)
        if self.goal.is_kinked:
            x = polish(_Correlations(self), x, rows, POLISH).x
        else:
            x = descend(self._objective(self.goal.target), x, rows, POLISH).x
        return self.coefficients(x[None])[0]

    def coefficients(self, points: Array) -> Array:
        """A of K points x, (K, n, M)."""
        return (points @ self._spread.T).reshape(-1, *self._shape)

    def slopes(self, gradients: Array) -> Array:
        """∂/∂x from ∂/∂a (K, n, M), (K, p)."""
        return gradients.reshape(len(gradients), -1) @ self._spread

    def _objective(self, measure: Measure) -> Objective:
        def objective(x: Array) -> tuple[float, Array]:
            value, gradient = self.cost.measure(self.coefficients(x[None])[0], measure)
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
