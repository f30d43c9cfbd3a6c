"""One descent of the search: from a random admissible trajectory, or from a variation of good ones.

Normalised D-optimality decides for a basin and the measures of the goal follow; where that is log
cond, the semidefinite programmes of `polish` end in its kink. Limits that are not linear are
elastic on the way and tightened in the last round, so that they hold between its samples.

Motions as points x of one vector, in which the optimisers work: vec(a) = S x.

S whitens the limits of the joints, scaled so that a point of size one reaches a bound. Values are
computed from the coefficients a; slopes are carried back, ∂f/∂x = Sᵀ ∂f/∂vec(a). A descent begins
at a random point, or near a good one (`varied`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import (
    LIMIT_STEP,
    LimitRows,
    Limits,
    constraints,
    inside,
    require_rest,
    whitening,
)
from runtime.excitation.search.conic import LinearRows
from runtime.excitation.search.criteria import criterion_of, rank, too_many
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import ConditionCost, Measure
from runtime.excitation.search.semidefinite_polish import polish
from runtime.excitation.search.sqp import TOLERANCE, Objective, descend
from runtime.library import Array, Indices, Library

NOISE = 0.2, 0.8  # least and largest noise on all coordinates of a variation; 1 reaches the bounds
FAR_NOISE = 0.45, 0.75
"""The same far from a parent: with less, most descents of a smooth criterion return to it; with
more, most are given up. Between 0.5 and 0.7 they gained twice as much as between 0.7 and 0.9."""
FAVOUR = 0.25  # probability that the best parent is chosen; the next ones follow a geometric law
FAR_FAVOUR = 0.35  # the same where a smooth criterion decides


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

    def near(self, x: Array) -> tuple[Indices, Array, Array]:
        """Numbers, values and slopes of all rows that a step could violate."""
        numbers, values, slopes = self._rows.linearised(self._coordinates.of_one(x))
        return numbers, values, self._coordinates.slopes(slopes)

    def values(self, x: Array, numbers: Indices) -> Array:
        """Values of chosen rows, (m,)."""
        return self._rows.values(self._coordinates.of_one(x))[numbers]

    def jacobian(self, x: Array, numbers: Indices) -> Array:
        """Slopes of chosen rows, (m, p)."""
        return self._coordinates.slopes(self._rows.jacobian(self._coordinates.of_one(x), numbers))


class Correlations:
    """Matrix C of the base regressor as a function of x."""

    def __init__(self, coordinates: Coordinates, cost: ConditionCost) -> None:
        self._coordinates, self._cost = coordinates, cost

    def at(self, points: Array) -> Array:
        """Matrices C of K points, (K, n_b, n_b)."""
        return self._cost.correlations(self._coordinates.coefficients(points))

    def slopes(self, points: Array, weight: Array) -> tuple[Array, Array]:
        """Matrices (K, n_b, n_b), and slopes ∂⟨F, C⟩/∂x for a constant symmetric F, (K, p)."""
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
    """Return a parent with noise on all coordinates, or with new motions of one or two joints."""
    x = _parent(rng, known, FAVOUR)
    if number % 3 == 2:
        return np.asarray(x + rng.uniform(*NOISE) * rng.normal(size=len(x)))
    return np.where(_chosen(rng, joints, 1 + number % 3, len(x)), drawn(rng), x)


def varied_far(rng: np.random.Generator, known: Array, number: int, joints: int) -> Array:
    """Return a parent with much noise, or with the mirrored motion of one joint.

    Seven of eight variations have noise on all coordinates, which leads to a better optimum twice
    as often as new motions of two joints. A mirrored motion keeps the amplitudes of its joint.
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


START = 0.5  # limit use of a random start: far enough inside to choose its basin
FINE_STEP = 0.01  # step of the last polish's grid, s: between its points motions overshoot by 1e-5
FINE_POINTS = 1000  # most points of that grid
POLISH = 40  # most semidefinite programmes, or steps of the last descent of a smooth goal
TIGHTENED = 2e-3  # of nonlinear limits in the last polish: their bend between samples
ELASTIC = 0.3  # violation of nonlinear limits above which a random start is shrunk
LATE_GAIN = 0.06
"""Log cond by which a variation may be worse than the best after a smooth stage; the other stages
and the polish gain 0.03 to 0.05 from there."""
TRIED = (40, 0.1), (80, 0.05)
"""A start of a smooth criterion is given up after so many steps where its log target is more than
the second number above the best of the rounds before: the next 40 steps gain 0.03 on average, and
those after the 80th as much."""
SMOOTH_TOLERANCE = 1e-4
"""Decrease of a smooth criterion below which a descent ends. Half of the steps of a random start
gain less; `Search.refined` descends the best one to the end."""
RETURNED = 0.3
"""RMS of coordinates below which a variation counts as its parent: a smooth stage ends 0.04 to 0.3
from its own polished optimum, 0.5 and more from others."""
SHRUNK, SHRINKS = 0.8, 60  # factor, and most of them: 1e-6 of the limits is no motion
LEAST = 1e-3  # use of the limits of joints below which other limits have left no room


class Search:
    """Descents from random starts and from variations of good ones.

    A start depends on its number and the seed alone, a variation also on its parents.

    Args:
        number: number of the descent, which with the seed decides the random part.
        parents: motions (n, M) [rad, m] each.
        best: best target so far.
    """

    def __init__(self, lib: Library, settings: DesignSettings) -> None:
        self.lib, self.settings = lib, settings
        self.home = np.asarray(lib.home if settings.home is None else settings.home, dtype=float)
        self.basis, size = settings.basis, settings.basis.size(settings.harmonics)
        self.criterion = criterion_of(settings.criterion, settings.information is not None)
        self.goal = self.criterion.goal(lib, self.home, settings.information)
        shape = self._grid = (lib, self.home, size, settings.duration)
        self.cost = ConditionCost(*shape, self.basis, settings.information)
        self._condition = ConditionCost(*shape, self.basis)
        self._tolerance = TOLERANCE if self.criterion.is_kinked else SMOOTH_TOLERANCE
        self.limits = self.joint_limits(LIMIT_STEP)
        self.constraints = constraints(lib, self.home, settings.safety)
        require_rest(self.constraints, self.home)
        self._seed, self._shape = settings.seed, (lib.n_joints, size)
        matrix, self._bound = self.limits.inequalities()
        spread = whitening(matrix, lib.n_joints)
        # Scaled so that a point x of size one reaches a bound.
        self._spread = spread * np.sqrt(len(matrix) / (3.0 * len(spread)))
        self._matrix = matrix @ self._spread
        self._coordinates = Coordinates(self._spread, self._shape)
        self._correlations = Correlations(self._coordinates, self.cost)
        self._coarse = self.limit_rows(LIMIT_STEP)

    def start(self, number: int, best: float = np.inf) -> tuple[float, Array]:
        """Target and coefficients (n, M) [rad, m] of a descent from a random motion.

        A start of a smooth criterion that is behind `best` is given up, see `TRIED`.
        """
        rows, elastic = LinearRows(self._matrix, self._bound), self._elastic(self._coarse)
        x = self._shrunk(self._random(number), ELASTIC)
        is_kinked = self.criterion.is_kinked
        for measure, steps in self.goal.stages if is_kinked else self.goal.stages[:-1]:
            objective, nearly = self._objective(measure), self._tolerance
            x = descend(objective, x, rows, steps, nearly, nonlinear=elastic).x
        if is_kinked:
            x = polish(self._correlations, x, rows, POLISH, nonlinear=elastic).x
        else:
            x = self._smooth(x, rows, elastic, best)
        return self._ended(x)

    def _smooth(
        self, x: Array, rows: LinearRows, elastic: ElasticLimits | None, best: float
    ) -> Array:
        """Last stage of a smooth goal, which ends early behind the best of the rounds before."""
        measure, iterations = self.goal.stages[-1]
        objective, curvature, done = self._objective(measure), None, 0
        for tried, behind in TRIED if np.isfinite(best) else ():
            steps = min(tried, iterations) - done
            part = descend(objective, x, rows, steps, self._tolerance, curvature, elastic)
            x, curvature, done = part.x, part.curvature, done + steps
            is_behind = self.value(self._coordinates.of_one(x)) > best + behind
            if is_behind or part.iterations < steps:
                return x
        left = iterations - done
        return descend(objective, x, rows, left, self._tolerance, curvature, elastic).x

    def variation(
        self, number: int, parents: tuple[Array, ...], best: float
    ) -> tuple[float, Array]:
        """Target and coefficients of a descent from a variation of a parent, see `varied`.

        Each joint has limits of its own, so that with new motions of some joints those of the
        others stay admissible. D-optimality is skipped. Where the criterion is kinked, what has
        come back to a parent after the next stage is that parent, and what is not below `best` +
        `LATE_GAIN` is given up.
        """
        rng = np.random.default_rng((self._seed, number, 1))
        known = self._coordinates.points(np.asarray(parents))
        is_smooth = not self.criterion.is_kinked
        if is_smooth:
            x = self._within_each(varied_far(rng, known, number, self._shape[0]))
        else:
            x = varied(rng, known, number, self._shape[0], self._drawn)
            x = x / max(1.0, float(np.max(self._matrix @ x)))
        rows, elastic = LinearRows(self._matrix, self._bound), self._elastic(self._coarse)
        x = self._shrunk(x, ELASTIC)
        if is_smooth:
            return self._ended(self._smooth(x, rows, elastic, best))
        (first, iterations), *later = self.goal.stages[1:]
        x = descend(self._objective(first), x, rows, iterations, nonlinear=elastic).x
        distances = np.sqrt(np.square(known - x).mean(axis=1))
        if distances.min() < RETURNED:
            back = parents[int(distances.argmin())]
            return self.value(back), back
        if self.value(self._coordinates.of_one(x)) > best + LATE_GAIN:
            return self._ended(x)
        for measure, iterations in later:
            x = descend(self._objective(measure), x, rows, iterations, nonlinear=elastic).x
        return self._ended(polish(self._correlations, x, rows, POLISH, nonlinear=elastic).x)

    def _within_each(self, x: Array) -> Array:
        """Point x with every joint scaled into its limits; a common factor shrinks all of them."""
        joints = x.reshape(self._shape)
        # A row limits one joint: its coefficients of the others are zero.
        use = np.einsum("rjm,jm->rj", self._matrix.reshape(-1, *self._shape), joints).max(axis=0)
        return np.asarray((joints / np.maximum(1.0, use)[:, None]).ravel())

    def _ended(self, x: Array) -> tuple[float, Array]:
        """Target of the goal and coefficients of x moved inside all limits."""
        a = inside(self.limits, self._coordinates.of_one(self._shrunk(x, TIGHTENED)))
        return self.value(a), a

    def guess(self, number: int) -> Array:
        """Coefficients (n, M) from which a start begins."""
        return self._coordinates.of_one(self._random(number))

    def require_rank(self) -> None:
        """Check that random motions excite all unknowns."""
        gram = self.cost.correlations(self.guess(0)[None])[0]
        excited = rank(gram)
        if excited < len(gram):
            raise IdentificationError(too_many(excited, len(gram), self._shape[1]))

    def _random(self, number: int) -> Array:
        """Random point well inside the limits."""
        return self._drawn(np.random.default_rng((self._seed, number)))

    def _drawn(self, rng: np.random.Generator) -> Array:
        x = rng.normal(size=len(self._spread))
        return np.asarray(x * (START / np.max(self._matrix @ x)))

    def value(self, a: Array) -> float:
        """Target of the goal, with log cond W̄_b in place of a smooth one."""
        if self.criterion.is_kinked:
            return self.cost.value_gradient(a)[0]
        if self.goal.errors is None:
            return self.cost.measure(a, self.goal.target)[0]
        condition = self._condition.value_gradient(a)[0]
        return self.cost.measure(a, self.goal.errors)[0] + self.goal.condition_share * condition

    def balanced(self, a: Array) -> Array:
        """Logs of the errors that the goal balances and of cond, (k,); else the target alone."""
        if not self.goal.balanced:
            return np.array([self.value(a)])
        errors = [self.cost.measure(a, measure)[0] for measure in self.goal.balanced]
        return np.array([*errors, self._condition.value_gradient(a)[0]])

    def refined(self, a: Array) -> Array:
        """Coefficients at the same optimum on a finer grid; `inside` alone would lose 0.5 %."""
        step = min(max(FINE_STEP, self._grid[-1] / 2 / FINE_POINTS), LIMIT_STEP)
        fine = self.joint_limits(step)
        matrix, bound = fine.inequalities()
        x = self._coordinates.points(inside(fine, a)[None])[0]
        rows = LinearRows(matrix @ self._spread, bound)
        elastic = self._elastic(self.limit_rows(step, TIGHTENED))
        if self.criterion.is_kinked:
            x = polish(self._correlations, x, rows, POLISH, nonlinear=elastic).x
        else:
            objective = self._objective(self.goal.last or self.goal.target)
            x = descend(objective, x, rows, POLISH, nonlinear=elastic).x
        return self._coordinates.of_one(x)

    def joint_limits(self, step: float, duration: float | None = None) -> Limits:
        """Limits of the joints on a grid."""
        lib, home, size, designed = self._grid
        end = designed if duration is None else duration
        return Limits(lib, home, size, end, step, self.basis, self.settings.margin)

    def limit_rows(
        self,
        step: float,
        tightened: float = 0.0,
        duration: float | None = None,
        share: float | None = None,
    ) -> LimitRows:
        """Nonlinear limits on a grid, of which the share `tightened` stays unused besides."""
        lib, home, size, designed = self._grid
        end = designed if duration is None else duration
        t = np.linspace(0, end, 2 * int(np.ceil(end / 2 / step)) + 1)
        phi = self.basis.at(lib, size, t, end)
        used = self.settings.margin if share is None else share
        return LimitRows(self.constraints, home, phi, self.basis.is_symmetric, tightened, used)

    def _elastic(self, rows: LimitRows) -> ElasticLimits | None:
        return ElasticLimits(self._coordinates, rows) if self.constraints else None

    def _shrunk(self, x: Array, violation: float) -> Array:
        """Point x scaled towards rest until nonlinear limits are violated by that much or less."""
        stopped: list[str] = []
        for _ in range(SHRINKS):
            a = self._coordinates.of_one(x)
            use = float(np.max(self._matrix @ x))
            if self._coarse.worst(a) <= violation and use >= LEAST:
                return x
            stopped = self._coarse.strongest(a) or stopped
            if use < LEAST:
                break
            x = SHRUNK * x
        raise IdentificationError(
            "the limits leave no room for a motion: shrunk to "
            f"{100 * LEAST:g} % of what the joints may do it still meets the limits of "
            f"{' and of '.join(stopped)}; relax one of them or choose another home"
        )

    def _objective(self, measure: Measure) -> Objective:
        def objective(x: Array) -> tuple[float, Array]:
            value, gradient = self.cost.measure(self._coordinates.of_one(x), measure)
            return value, self._coordinates.slopes(gradient[None])[0]

        return objective
