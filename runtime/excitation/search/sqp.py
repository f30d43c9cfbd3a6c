"""min f(x) s.t. A x ≤ b, g(x) ≤ 0 by sequential quadratic programming along feasible directions.

Damped BFGS (Powell 1978) for the curvature. Every iterate keeps A x ≤ b; g is elastic and enters
the merit f + μ max(0, max g), see `elastic`. Independent of robots.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.excitation.search.conic import Block, LinearRows, solve
from runtime.excitation.search.elastic import MU, Curved, Nonlinear, corrected
from runtime.library import Array

Objective = Callable[[Array], tuple[float, Array]]

_ARMIJO = 1e-4
_DAMPING = 0.2
_HALVINGS = 20
_PATIENCE = 3
"""Number of steps in a row without progress that ends the descent."""


@dataclass(frozen=True, slots=True)
class Descended:
    """End of a descent.

    Attributes:
        x: point with A x ≤ b.
        value: f(x); without g never above that of the start.
        iterations: steps taken.
        curvature: the BFGS matrix, for a next objective that is like this one.
    """

    x: Array
    value: float
    iterations: int
    curvature: Array


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
    tolerance: float = 1e-6,
    curvature: Array | None = None,
    nonlinear: Nonlinear | None = None,
) -> Descended:
    """Descend from an x with A x ≤ b.

    Args:
        objective: f and its gradient.
        x: start, (p,).
        rows: A and b.
        iterations: largest number of steps.
        tolerance: of the merit: ends when the predicted decrease, or that of three steps, is below.
        curvature: first Hessian, (p, p); default is the length of the gradient times 1.
        nonlinear: g.

    Returns:
        The end of the descent.
    """

    def at(x: Array) -> _Point:
        value, gradient = objective(x)
        return _Point(x, value, gradient, 0.0 if nonlinear is None else nonlinear.violation(x))

    point = at(x)
    n, done, idle = len(x), 0, 0
    fresh = np.eye(n) * max(1e-3, float(np.linalg.norm(point.gradient)))
    hessian = fresh if curvature is None else curvature
    while done < iterations and idle < _PATIENCE:
        curved = None if nonlinear is None else Curved(nonlinear, point.x)
        # The quadratic programme of the step. Where the solver fails, the first Hessian is tried.
        direction = _direction(hessian, point, rows, curved)
        if direction is None:
            if hessian is fresh:
                break
            hessian = fresh
            continue
        step, duals = direction
        # Predicted decrease of the merit f + μ v along the step.
        slope = float(point.gradient @ step)
        if curved is not None:
            slope += MU * (curved.after(step) - point.violation)
        if not slope < -tolerance:
            break
        after = _search(at, point, step, slope, rows, nonlinear)
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


def _direction(
    hessian: Array, at: _Point, rows: LinearRows, curved: Curved | None
) -> tuple[Array, Array] | None:
    """Step and multipliers of the curved rows."""
    p = len(at.x)
    # Nearly singular BFGS matrices stop the interior point early.
    safe = hessian + np.eye(p) * (1e-9 * np.trace(hessian) / p)
    if curved is None:
        plain = rows.solve(at.x, lambda a, slack: solve(safe, at.gradient, [Block(a, slack)]))
        return None if plain is None else (plain[0], np.zeros(0))
    # The last variable is t of the elastic rows g + J d ≤ t, at the price μ.
    quadratic = np.zeros((p + 1, p + 1))
    quadratic[:p, :p] = safe
    linear = np.append(at.gradient, MU)

    def programme(a: Array, slack: Array) -> tuple[Array, list[Array]] | None:
        limits = Block(np.hstack([a, np.zeros((len(a), 1))]), slack)
        return solve(quadratic, linear, [limits, curved.block(p + 1)])

    solution = rows.solve(at.x, programme, curved.grow)
    return None if solution is None else (solution[0][:p], solution[1][1])


def _search(
    at: Callable[[Array], _Point],
    point: _Point,
    step: Array,
    slope: float,
    rows: LinearRows,
    nonlinear: Nonlinear | None,
) -> _Point | None:
    """Halve the step from the reach of the linear rows until the merit falls enough (Armijo)."""
    reach = rows.reach(point.x, step)
    for halving in range(_HALVINGS):
        after = at(point.x + reach * step)
        if after.merit <= point.merit + _ARMIJO * reach * slope:
            return after
        # The second-order correction of Maratos, once: see `elastic.corrected`.
        if nonlinear is not None and halving == 0:
            back = corrected(nonlinear, after.x)
            if back is not None:
                better = at(after.x + rows.reach(after.x, back) * back)
                if better.merit <= point.merit + _ARMIJO * reach * slope:
                    return better
        reach *= 0.5
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
