"""min f(x) s.t. A x ≤ b, g(x) ≤ 0 by sequential quadratic programming along feasible directions.

Damped BFGS (Powell 1978) for the curvature. Every iterate keeps A x ≤ b; g is elastic and enters
the merit f + μ max(0, max g), see `conic`. Independent of robots.

The programme of a step is strictly convex and has many rows of which few are active:

    min ½ xᵀP x + qᵀx  s.t.  A x ≤ b

With P = L Lᵀ, y = Lᵀx + L⁻¹q and B = L⁻¹Aᵀ this is the point of least distance from the origin,
min |y| s.t. Bᵀy ≤ b + BᵀL⁻¹q = h, whose dual is one nonnegative least squares problem (Lawson and
Hanson 1974, ch. 23.4): with u ≥ 0 that minimises |[B; hᵀ] u + e|, e the last unit vector, and ρ its
residual, y = −ρ_y / ρ_e, and u / ρ_e are the multipliers. Active rows are exact, to rounding.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, lapack
from scipy.optimize import nnls

from runtime.excitation.search.conic import MU, ConeBlock, Curved, LinearRows, Nonlinear
from runtime.library import Array

_EMPTY = 1e-12  # residual ρ_e below which the rows leave no point, to rounding
Objective = Callable[[Array], tuple[float, Array]]
TOLERANCE = 1e-6  # default decrease of the merit below which a descent ends
_ARMIJO = 1e-4
_DAMPING = 0.2
_TRIALS = 20
_SHORTEST, _LONGEST = 0.1, 0.5  # factors by which a step is shortened, at most and at least
_PATIENCE = 3  # number of steps in a row without progress that ends the descent


@dataclass(frozen=True, slots=True)
class Descended:
    """End of a descent."""

    x: Array  # point with A x ≤ b
    value: float  # f(x); without g never above that of the start
    iterations: int  # steps taken
    curvature: Array  # the BFGS matrix, for a next objective that is like this one


@dataclass(frozen=True, slots=True)
class _Point:
    """Point x with f, ∂f/∂x and the violation v."""

    x: Array
    value: float
    gradient: Array
    violation: float

    @property
    def merit(self) -> float:
        return self.value + MU * self.violation


def descend(
    objective: Objective,
    x: Array,
    rows: LinearRows,
    iterations: int = 100,
    tolerance: float = TOLERANCE,
    curvature: Array | None = None,
    nonlinear: Nonlinear | None = None,
) -> Descended:
    """Descend from an x with A x ≤ b."""

    def at(x: Array) -> _Point:
        value, gradient = objective(x)
        return _Point(x, value, gradient, 0.0 if nonlinear is None else nonlinear.violation(x))

    point = at(x)
    n, done, idle = len(x), 0, 0
    fresh = np.eye(n) * max(1e-3, float(np.linalg.norm(point.gradient)))
    hessian = fresh if curvature is None else curvature
    while done < iterations and idle < _PATIENCE:
        model = _Model(hessian, point, rows, nonlinear)
        # The quadratic programme of the step. Where it fails, the first Hessian is tried.
        direction = model.step()
        if direction is None:
            if hessian is fresh:
                break
            hessian = fresh
            continue
        step, duals = direction
        curved = model.curved
        # Predicted decrease of the merit f + μ v along the step.
        slope = float(point.gradient @ step)
        if curved is not None:
            slope += MU * (curved.after(step) - point.violation)
        if not slope < -tolerance:
            break
        after = _search(at, point, step, slope, rows, model)
        if after is None:
            break
        # BFGS on the gradient of the Lagrangian: the rows contribute with their multipliers.
        change = after.gradient - point.gradient
        if curved is not None:
            change += curved.bent(duals, after.x)
        hessian = _damped(hessian, after.x - point.x, change)
        idle = idle + 1 if point.merit - after.merit < tolerance else 0
        point = after
        done += 1
    return Descended(point.x, point.value, done, hessian)


class _Model:
    """The programme of a step near a point; with curved rows t of g + J d ≤ t is a variable."""

    def __init__(
        self, hessian: Array, at: _Point, rows: LinearRows, nonlinear: Nonlinear | None
    ) -> None:
        p = len(at.x)
        # Nearly singular BFGS matrices have no factor.
        quadratic = hessian + np.eye(p) * (1e-9 * np.trace(hessian) / p)
        self._x, self._rows = at.x, rows
        self.curved = None if nonlinear is None else Curved(nonlinear, at.x)
        if self.curved is None:
            self._programme = QuadraticProgramme(quadratic, at.gradient)
            return
        # The price of t is μ t (1 + t / 2), strictly convex; steps end at t far below 1.
        quadratic = block_diag(quadratic, np.full((1, 1), MU))
        self._programme = QuadraticProgramme(quadratic, np.append(at.gradient, MU))

    def step(self) -> tuple[Array, Array] | None:
        """Step and multipliers of the curved rows; None where the programme failed."""
        if self.curved is not None:
            return self._elastic(self.curved)
        plain = self._rows.solve(
            self._x, lambda a, slack: self._programme.solve([ConeBlock(a, slack)])
        )
        return None if plain is None else (plain[0], np.zeros(0))

    def corrected(self, step: Array) -> Array | None:
        """Step with the rows as they are after the given one; None without curved rows."""
        if self.curved is None:
            return None
        solution = self._elastic(self.curved.corrected(step))
        return None if solution is None else solution[0]

    def _elastic(self, curved: Curved) -> tuple[Array, Array] | None:
        p = len(self._x)

        def programme(a: Array, slack: Array) -> tuple[Array, list[Array]] | None:
            limits = ConeBlock(np.hstack([a, np.zeros((len(a), 1))]), slack)
            return self._programme.solve([limits, curved.block(p + 1)])

        solution = self._rows.solve(self._x, programme, curved.grow)
        return None if solution is None else (solution[0][:p], solution[1][1])


def _search(
    at: Callable[[Array], _Point],
    point: _Point,
    step: Array,
    slope: float,
    rows: LinearRows,
    model: _Model,
) -> _Point | None:
    """Shorten the step from the reach of the linear rows until the merit falls enough (Armijo).

    Where curved rows bend away from the full step d, its correction d' makes it the arc
    t d + t² (d' − d), whose points lie between x, x + d and x + d', so that it keeps the linear
    rows, and whose violation grows with t³ (Maratos 1978; Mayne and Polak 1982).
    """
    full = rows.reach(point.x, step) * step
    bend, share = np.zeros_like(full), 1.0
    for trial in range(_TRIALS):
        after = at(point.x + share * full + share**2 * bend)
        if after.merit <= point.merit + _ARMIJO * share * slope:
            return after
        if trial == 0 and after.violation > point.violation:
            other = model.corrected(full)
            if other is not None:
                bend = rows.reach(point.x, other) * other - full
                continue
        # Minimum of the parabola through the merit, its slope and the merit of this trial.
        excess = after.merit - point.merit - share * slope
        share *= min(_LONGEST, max(_SHORTEST, -share * slope / (2 * excess)))
    return None


def _damped(hessian: Array, step: Array, change: Array) -> Array:
    """BFGS update with the change of gradient mixed towards H s until the curvature is positive."""
    along = hessian @ step
    old, new = float(step @ along), float(step @ change)
    if not old > 0:
        return hessian
    # Powell: y ← θ y + (1 − θ) H s with sᵀ y = 0.2 sᵀ H s where it would be smaller.
    part = 1.0 if new >= _DAMPING * old else (1 - _DAMPING) * old / (old - new)
    mixed = part * change + (1 - part) * along
    return hessian - np.outer(along, along) / old + np.outer(mixed, mixed) / float(step @ mixed)


class QuadraticProgramme:
    """Objective ½ xᵀP x + qᵀx, factored once for any number of sets of rows."""

    def __init__(self, quadratic: Array, linear: Array) -> None:
        """Factor the objective."""
        self._factor, status = lapack.dpotrf(quadratic, lower=True, clean=True)
        self.is_convex = status == 0
        """P is positive definite."""
        self._shift = self._lower(linear) if self.is_convex else linear
        self._size = float(np.linalg.norm(self._shift)) or 1.0

    def solve(self, blocks: Sequence[ConeBlock]) -> tuple[Array, list[Array]] | None:
        """Solve for blocks of rows b − A x ≥ 0."""
        if not self.is_convex:
            return None
        a, b = (np.concatenate([getattr(one, name) for one in blocks]) for name in ("a", "b"))
        images = self._lower(a.T)
        # In units of |L⁻¹q|, which |y| does not exceed where x = 0 is admissible: ρ_e ≥ ½ then.
        heights = (b + self._shift @ images) / self._size
        target = np.append(np.zeros(len(images)), -1.0)
        try:
            u = nnls(np.vstack([images, heights]), target)[0]
        except RuntimeError:  # more iterations than three per row
            return None
        remaining = 1.0 + heights @ u
        if not remaining > _EMPTY:
            return None
        multipliers = u * (self._size / remaining)
        y = -(images @ multipliers)
        x = lapack.dtrtrs(self._factor, y - self._shift, lower=True, trans=True)[0]
        ends = np.cumsum([len(one.b) for one in blocks])[:-1]
        return x, np.split(multipliers, ends)

    def _lower(self, right: Array) -> Array:
        """Solution X of L X = B."""
        return np.asarray(lapack.dtrtrs(self._factor, right, lower=True)[0])
