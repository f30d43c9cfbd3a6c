"""Levenberg–Marquardt: minimise L(x) = (‖r(x)‖² + ρ) · scale by damped Gauss–Newton steps.

(JᵀJ + μI) δ = −Jᵀr is solved as δ = −Jᵀ (JJᵀ + μI)⁻¹ r, which is smaller where x has more entries
than r has, as λ does. μ follows the gain ratio of Madsen, Nielsen & Tingleff, *Methods for
non-linear least squares problems*, 2004, algorithm 3.16.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.estimators.optimizers.adam import Array
from runtime.estimators.optimizers.loop import Outcome, Status, Trace

_HOPELESS = 1e200


@dataclass(frozen=True, slots=True)
class LevenbergOptions:
    """Settings of the loop.

    Attributes:
        max_iterations: steps tried, accepted or not.
        first_damping: μ at the start, relative to the largest squared column of J.
        step_tolerance: stop when ‖δ‖ falls below this fraction of ‖x‖.
        decrease_tolerance: stop when a step lowers L by less than this fraction, as predicted.
    """

    max_iterations: int = 200
    first_damping: float = 1e-8
    step_tolerance: float = 1e-12
    decrease_tolerance: float = 1e-12


@dataclass(slots=True)
class LevenbergState:
    """Where a descent stands."""

    x: Array
    residual: Array
    jacobian: Array
    loss: float
    damping: float
    growth: float = 2.0
    status: Status | None = None


def levenberg_start(
    x: Array,
    residual_jacobian: Callable[[Array], tuple[Array, Array]],
    rest: float,
    scale: float,
    options: LevenbergOptions,
) -> LevenbergState:
    """First point with its damping."""
    residual, jacobian = residual_jacobian(x)
    loss = float(residual @ residual + rest) * scale
    damping = options.first_damping * float(np.max(np.sum(jacobian**2, axis=0)))
    state = LevenbergState(np.array(x, dtype=float), residual, jacobian, loss, damping)
    if not np.isfinite(loss):
        state.status = Status.DIVERGED
    return state


def levenberg_step(
    state: LevenbergState,
    residual_jacobian: Callable[[Array], tuple[Array, Array]],
    rest: float,
    scale: float,
    options: LevenbergOptions,
) -> bool:
    """Try one step; True when it was accepted. `state.status` says when to stop."""
    x, residual, jacobian = state.x, state.residual, state.jacobian
    normal = jacobian @ jacobian.T + state.damping * np.eye(len(residual))
    try:
        factor = np.linalg.cholesky(normal)
    except np.linalg.LinAlgError:
        _reject(state)
        return False
    step = -jacobian.T @ np.linalg.solve(factor.T, np.linalg.solve(factor, residual))
    if np.linalg.norm(step) <= options.step_tolerance * (
        np.linalg.norm(x) + options.step_tolerance
    ):
        state.status = Status.CONVERGED
        return False
    predicted = float(step @ (state.damping * step - jacobian.T @ residual)) * scale
    new_residual, new_jacobian = residual_jacobian(x + step)
    loss = float(new_residual @ new_residual + rest) * scale
    if not (loss < state.loss and predicted > 0):
        _reject(state)
        return False
    gain, decrease = (state.loss - loss) / predicted, state.loss - loss
    if max(decrease, predicted) <= options.decrease_tolerance * state.loss:
        state.status = Status.CONVERGED
    state.x, state.residual, state.jacobian, state.loss = x + step, new_residual, new_jacobian, loss
    state.damping *= max(1 / 3, 1 - (2 * gain - 1) ** 3)
    state.growth = 2.0
    return True


def levenberg(
    start: Array,
    residual_jacobian: Callable[[Array], tuple[Array, Array]],
    validation: Callable[[Array], float],
    options: LevenbergOptions,
    rest: float = 0.0,
    scale: float = 0.5,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Descend until no step lowers L any more.

    Args:
        start: first point.
        residual_jacobian: r (m,) and J (m, size) at x.
        validation: loss that is recorded beside L; it does not stop the descent.
        options: of the loop.
        rest: ρ.
        scale: of the loss.
        progress: called with iteration and L.
    """
    state = levenberg_start(start, residual_jacobian, rest, scale, options)
    trace: list[tuple[int, float, float]] = []
    status, iteration = state.status or Status.MAX_ITERATIONS, 0
    try:
        while state.status is None and iteration < options.max_iterations:
            iteration += 1
            if levenberg_step(state, residual_jacobian, rest, scale, options):
                trace.append((iteration, state.loss, validation(state.x)))
            if progress is not None:
                progress(iteration, state.loss)
        status = state.status or status
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    columns = zip(*trace, strict=True) if trace else ((), (), ())
    traces = Trace(*(tuple(c) for c in columns))
    held = validation(state.x) if np.isfinite(state.loss) else np.inf
    return Outcome(state.x, held, iteration, status, traces)


def _reject(state: LevenbergState) -> None:
    state.damping *= state.growth
    state.growth *= 2
    if not state.damping < _HOPELESS:
        state.status = Status.STALLED
