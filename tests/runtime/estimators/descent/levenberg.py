"""Levenberg–Marquardt as in the textbook, one NumPy step at a time: oracle of the compiled loop.

L(x) = (‖r(x)‖² + ρ) · scale; (JᵀJ + μI) δ = −Jᵀr is solved as δ = −Jᵀ (JJᵀ + μI)⁻¹ r. μ follows the
gain ratio of Madsen, Nielsen & Tingleff, *Methods for non-linear least squares problems*, 2004,
algorithm 3.16.
"""

from collections.abc import Callable

import numpy as np

from runtime.estimators.descent.descent import Descent, least_squares
from runtime.estimators.optimizers import LevenbergOptions, Outcome, Status, trace_of

Residual = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def levenberg(
    of: Residual,
    x: np.ndarray,
    options: LevenbergOptions,
    rest: float = 0.0,
    scale: float = 0.5,
    validation: Callable[[np.ndarray], float] = lambda _: 0.0,
) -> Outcome:
    """Accepted steps are rows of the trace; r (m,) and J (m, size) are those of `of`."""
    r, J = of(x)
    loss, growth, rows = (r @ r + rest) * scale, 2.0, []
    mu, status, k = options.first_damping * np.max(np.sum(J**2, axis=0)), Status.MAX_ITERATIONS, 0
    while k < options.max_iterations and status is Status.MAX_ITERATIONS:
        k += 1
        step = -J.T @ np.linalg.solve(J @ J.T + mu * np.eye(len(r)), r)
        tolerance = options.step_tolerance
        if np.linalg.norm(step) <= tolerance * (np.linalg.norm(x) + tolerance):
            status = Status.CONVERGED
            break
        predicted = (step @ (mu * step - J.T @ r)) * scale
        new, slope = of(x + step)
        decrease = loss - (new @ new + rest) * scale
        if not (decrease > 0 and predicted > 0):
            mu, growth = mu * growth, growth * 2
            continue
        if max(decrease, predicted) <= options.decrease_tolerance * loss:
            status = Status.CONVERGED
        x, r, J, loss, growth = x + step, new, slope, loss - decrease, 2.0
        mu *= max(1 / 3, 1 - (2 * decrease / predicted - 1) ** 3)
        rows.append((k, float(loss), validation(x)))
    return Outcome(x, validation(x), k, status, trace_of(rows))


def levenberg_of(descent: Descent, options: LevenbergOptions) -> Outcome:
    """Descend as the compiled loop does: r = R y − r₀, y = [K π(x); ψ], J = R [K ∂π/∂x, 1]."""
    lib, size = descent.problem.lib, descent.problem.start.size
    squares = least_squares(descent.statistics, descent.objective.unit)

    def of(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        jacobian_of = lib.cholesky_jacobian if descent.cholesky else lib.pi_jacobian
        blocks = jacobian_of(x[:size])
        by_pi = lib.base_matrix.reshape(-1, *blocks.shape[:2])
        by_x = np.einsum("bki,kij->bkj", by_pi, blocks).reshape(len(by_pi), size)
        y = np.concatenate([lib.base_matrix @ descent.bodies(x), x[size:]])
        over_base, over_psi = np.split(squares.factor, [len(by_x)], axis=1)
        return squares.factor @ y - squares.target, np.hstack([over_base @ by_x, over_psi])

    scale = squares.rest, squares.scale
    return levenberg(of, descent.x0, options, *scale, descent.validation_loss)
