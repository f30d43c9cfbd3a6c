"""One start of the search: a random admissible trajectory, descended to a local optimum.

Normalised D-optimality decides for a basin, Schatten norms lead to the kink of log cond, and the
semidefinite programmes of `polish` end in it. Limits that are not linear are elastic on the way
and tightened in the last round, so that they hold between its samples.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.excitation.conic import Rows
from runtime.excitation.cost import ConditionCost
from runtime.excitation.criteria import Criterion, d_optimal, schatten
from runtime.excitation.limits import LIMIT_STEP, Limits, inside, whitening
from runtime.excitation.polish import polish
from runtime.excitation.rows import LawRows
from runtime.excitation.safety import Safety, laws
from runtime.excitation.sqp import Objective, descend
from runtime.excitation.trajectory import fourier_basis
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
TIGHTENED = 2e-3
"""Of nonlinear limits in the last polish: they bend that much between its samples."""
ELASTIC = 0.3
"""Violation of nonlinear limits from which on a random start is shrunk."""
SHRUNK = 0.8
"""Factor of one such shrinking, and"""
SHRINKS = 60
"""at most so many: 0.8^60 is 1e-6 of the joints' limits, no motion any more."""


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
        safety: limits beyond those of joints; None as in the document.
    """

    folder: Path
    level: str
    home: Array
    harmonics: int
    duration: float
    seed: int
    safety: Safety | None = None

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
        self.laws = laws(lib, problem.home, problem.safety)
        matrix, self._bound = self.limits.inequalities()
        spread = whitening(matrix, lib.n_joints)
        # Of `whitening`'s unit vectors each row sees a share; now x of size one reaches a bound.
        self._spread = spread * np.sqrt(len(matrix) / (3.0 * len(spread)))
        self._matrix = matrix @ self._spread
        self._elastic = _Elastic(self, self.law_rows(LIMIT_STEP)) if self.laws else None

    def start(self, number: int) -> tuple[float, Array]:
        """Log cond and coefficients (n, M), within the limits of the descent's grid.

        Raises:
            IdentificationError: the limits leave no room for any motion.
        """
        rng = np.random.default_rng((self._seed, number))
        x = rng.normal(size=len(self._spread))
        x *= START / np.max(self._matrix @ x)
        x = self._shrunk(x, ELASTIC)
        rows = Rows(self._matrix, self._bound)
        for criterion, iterations in STAGES:
            objective = self._objective(criterion)
            x = descend(objective, x, rows, iterations, nonlinear=self._elastic).x
        x = polish(_Correlations(self), x, rows, POLISH, nonlinear=self._elastic).x
        a = inside(self.limits, self.coefficients(self._shrunk(x, TIGHTENED)[None])[0])
        return self.cost.value_gradient(a)[0], a

    def refined(self, a: Array) -> Array:
        """The same optimum on a finer grid: pulled inside there alone it would lose 0.5 %."""
        step = max(FINE_STEP, self._grid[-1] / 2 / FINE_POINTS)
        fine = Limits(*self._grid, step=min(step, LIMIT_STEP))
        matrix, bound = fine.inequalities()
        x = np.linalg.solve(self._spread, inside(fine, a).ravel())
        rows = Rows(matrix @ self._spread, bound)
        elastic = _Elastic(self, self.law_rows(FINE_STEP, TIGHTENED)) if self.laws else None
        x = polish(_Correlations(self), x, rows, POLISH, nonlinear=elastic).x
        return self.coefficients(x[None])[0]

    def law_rows(self, step: float, tightened: float = 0.0) -> LawRows:
        """The nonlinear limits on a grid of this step, s."""
        lib, home, harmonics, duration = self._grid
        t = np.linspace(0, duration, 2 * int(np.ceil(duration / 2 / step)) + 1)
        basis = fourier_basis(lib, harmonics, t, duration)
        return LawRows(self.laws, home, basis, half=True, tightened=tightened)

    def coefficients(self, points: Array) -> Array:
        """A of K points x, (K, n, M)."""
        return (points @ self._spread.T).reshape(-1, *self._shape)

    def slopes(self, gradients: Array) -> Array:
        """∂/∂x from ∂/∂a (K, n, M), (K, p)."""
        return gradients.reshape(-1, len(self._spread)) @ self._spread

    def _shrunk(self, x: Array, violation: float) -> Array:
        """X scaled towards rest until the nonlinear limits are violated by no more than this."""
        if self._elastic is None:
            return x
        for _ in range(SHRINKS):
            if self._elastic.violation(x) <= violation:
                return x
            x = SHRUNK * x
        raise IdentificationError("no room")

    def _objective(self, criterion: Criterion) -> Objective:
        def objective(x: Array) -> tuple[float, Array]:
            value, gradient = self.cost.criterion(self.coefficients(x[None])[0], criterion)
            return value, self.slopes(gradient[None])[0]

        return objective


class _Elastic:
    """The nonlinear limits as functions of x."""

    def __init__(self, search: Search, rows: LawRows) -> None:
        self._search, self._rows = search, rows

    def violation(self, x: Array) -> float:
        return max(0.0, self._rows.worst(self._search.coefficients(x[None])[0]))

    def near(self, x: Array) -> tuple[NDArray[np.intp], Array, Array]:
        numbers, values, slopes = self._rows.linearised(self._search.coefficients(x[None])[0])
        return numbers, values, self._search.slopes(slopes)

    def jacobian(self, x: Array, numbers: NDArray[np.intp]) -> Array:
        a = self._search.coefficients(x[None])[0]
        return self._search.slopes(self._rows.jacobian(a, numbers))


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
