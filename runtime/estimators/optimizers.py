"""Adam with early stopping, and what every descent returns: point, losses, and why it ended.

    m, v ← moving averages of g, g²;   x ← x − η m̂ / (√v̂ + ε)

ε stands outside the square root. Source: Kingma & Ba 2015; document Eqs. 4.42–4.46.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from runtime.library import Array


class Status(Enum):
    """Why the loop ended, as advice."""

    PATIENCE = "converged: the validation loss stopped improving"
    MAX_ITERATIONS = (
        "stopped at the iteration limit while still improving; "
        "allow more iterations, or take a larger step"
    )
    INTERRUPTED = "interrupted by the user; the best point so far is kept"
    CONVERGED = "converged: no step lowers the loss noticeably any more"
    STALLED = (
        "stalled: no step lowers the loss, however small; the optimum may lie at the edge of "
        "consistency, compare with pc-ols"
    )
    DIVERGED = "the loss became infinite or NaN; the best point before is kept, take a smaller step"


@dataclass(frozen=True, slots=True)
class StoppingRule:
    """When to validate and when to stop."""

    max_iterations: int  # hard limit
    patience: int  # iterations without improvement of the best validation loss
    validate_every: int = 5  # iterations between validations
    threshold: float = 2e-6  # an improvement counts when it exceeds this, absolute


@dataclass(frozen=True, slots=True)
class Trace:
    """Losses at the iterations that were validated."""

    iteration: tuple[int, ...]
    training: tuple[float, ...]
    validation: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Point that a descent ends with, its validation loss, and how it was reached."""

    x: Array
    validation: float
    iterations: int
    status: Status
    trace: Trace


def trace_of(rows: Sequence[tuple[int, float, float]]) -> Trace:
    """Trace from rows of iteration, training loss and validation loss."""
    columns = zip(*rows, strict=True) if rows else ((), (), ())
    return Trace(*(tuple(column) for column in columns))


@dataclass(frozen=True, slots=True)
class AdamOptions:
    """η, β₁, β₂, ε; a data class, whose names are keys of saved settings."""

    learning_rate: float = 1e-3
    beta1: float = 0.9
    beta2: float = 0.999
    epsilon: float = 1e-8


def adam(
    value_gradient: Callable[[Array], tuple[float, Array]],
    options: AdamOptions,
    start: Array,
    validation: Callable[[Array], float],
    rule: StoppingRule,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Descend by Adam with early stopping; the point of the lowest validation loss is returned.

    `value_gradient` may draw a mini-batch at each call. The outcome is DIVERGED at once where the
    start has no finite loss.
    """
    x = np.array(start, dtype=float)
    m, v = np.zeros(x.size), np.zeros(x.size)
    best, best_x, improved_at, step = validation(x), x, 0, 0
    rows: list[tuple[int, float, float]] = []
    if not np.isfinite(best):
        return Outcome(best_x, best, 0, Status.DIVERGED, trace_of(rows))
    status = Status.MAX_ITERATIONS
    try:
        while step < rule.max_iterations:
            step += 1
            loss, gradient = value_gradient(x)
            m = options.beta1 * m + (1 - options.beta1) * gradient
            v = options.beta2 * v + (1 - options.beta2) * gradient**2
            # The moments start at zero; dividing by 1 − βᵏ removes that bias.
            m_hat, v_hat = m / (1 - options.beta1**step), v / (1 - options.beta2**step)
            x = x - options.learning_rate * m_hat / (np.sqrt(v_hat) + options.epsilon)
            if step % rule.validate_every == 0:
                held = validation(x)
                if not np.isfinite(held):
                    status = Status.DIVERGED
                    break
                rows.append((step, loss, held))
                if held < best - rule.threshold:
                    best, best_x, improved_at = held, x, step
                if progress is not None:
                    progress(step, best)
            if step - improved_at >= rule.patience:
                status = Status.PATIENCE
                break
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    return Outcome(best_x, best, step, status, trace_of(rows))


@dataclass(frozen=True, slots=True)
class LevenbergOptions:
    """Settings of a descent by Levenberg–Marquardt."""

    max_iterations: int = 200  # steps tried, accepted or not
    first_damping: float = 1e-8  # μ at the start, relative to the largest squared column of J
    step_tolerance: float = 1e-12  # stop when ‖δ‖ falls below this fraction of ‖x‖
    decrease_tolerance: float = 1e-12  # stop where a predicted decrease of L is less than this
