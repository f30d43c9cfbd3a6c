"""min f(x) s.t. A x ≤ b by sequential quadratic programming along feasible directions.

Damped BFGS (Powell 1978) for the curvature; every iterate is admissible, so the search can end at
any of them. Knows nothing of robots.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.excitation.conic import Block, Rows, solve
from runtime.library import Array

Objective = Callable[[Array], tuple[float, Array]]

_ARMIJO = 1e-4
_DAMPING = 0.2
_HALVINGS = 20
_PATIENCE = 3
"""Steps in a row without progress that end the descent."""


@dataclass(frozen=True, slots=True)
class Descended:
    """Where the descent ended.

    Attributes:
        x: admissible.
        value: f(x), never above that of the start.
        iterations: steps taken.
        curvature: the BFGS matrix, for a next objective that is like this one.
    """

    x: Array
    value: float
    iterations: int
    curvature: Array


def descend(
    objective: Objective,
    x: Array,
    rows: Rows,
    iterations: int = 100,
    tolerance: float = 1e-6,
    curvature: Array | None = None,
) -> Descended:
    """Descend from an admissible x.

    Args:
        objective: f and its gradient.
        x: start, A x ≤ b.
        rows: A and b.
        iterations: at most.
        tolerance: of f: ends when the predicted decrease, or that of three steps, is below.
        curvature: first Hessian, default is the gradient's length times 1.
    """
    value, gradient = objective(x)
    n, done, idle = len(x), 0, 0
    fresh = np.eye(n) * max(1e-3, float(np.linalg.norm(gradient)))
    hessian = fresh if curvature is None else curvature
    while done < iterations and idle < _PATIENCE:
        step = _direction(hessian, gradient, x, rows)
        if step is None:
            if hessian is fresh:
                break
            hessian = fresh
            continue
        slope = float(gradient @ step)
        if not slope < -tolerance:
            break
        found = _search(objective, x, value, step, slope, rows.reach(x, step))
        if found is None:
            break
        after, new_value, new_gradient = found
        hessian = _damped(hessian, after - x, new_gradient - gradient)
        idle = idle + 1 if value - new_value < tolerance else 0
        x, value, gradient = after, new_value, new_gradient
        done += 1
    return Descended(x, value, done, hessian)


def _direction(hessian: Array, gradient: Array, x: Array, rows: Rows) -> Array | None:
    # Nearly singular BFGS matrices stop the interior point early.
    safe = hessian + np.eye(len(x)) * (1e-9 * np.trace(hessian) / len(x))
    found = rows.solve(x, lambda a, slack: solve(safe, gradient, [Block(a, slack)]))
    return None if found is None else found[0]


def _search(
    objective: Objective, x: Array, value: float, step: Array, slope: float, reach: float
) -> tuple[Array, float, Array] | None:
    """Halve from `reach` until f falls enough (Armijo)."""
    for _ in range(_HALVINGS):
        after = x + reach * step
        new_value, new_gradient = objective(after)
        if new_value <= value + _ARMIJO * reach * slope:
            return after, new_value, new_gradient
        reach *= 0.5
    return None


def _damped(hessian: Array, step: Array, change: Array) -> Array:
    """BFGS with the change of gradient mixed towards H s until the curvature is positive."""
    along = hessian @ step
    old, new = float(step @ along), float(step @ change)
    if not old > 0:
        return hessian
    part = 1.0 if new >= _DAMPING * old else (1 - _DAMPING) * old / (old - new)
    mixed = part * change + (1 - part) * along
    return hessian - np.outer(along, along) / old + np.outer(mixed, mixed) / float(step @ mixed)
