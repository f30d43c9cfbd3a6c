"""The loop of all first-order methods: step, validate now and then, keep the best, stop in time."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from runtime.estimators.optimizers.adam import AdamOptions, Array, adam_start, adam_step


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
    """When to validate and when to stop.

    Attributes:
        max_iterations: hard limit.
        patience: iterations without improvement of the best validation loss.
        validate_every: iterations between validations.
        threshold: an improvement counts when it exceeds this, absolute.
    """

    max_iterations: int
    patience: int
    validate_every: int = 5
    threshold: float = 2e-6


@dataclass(frozen=True, slots=True)
class Trace:
    """Losses at the validated iterations."""

    iteration: tuple[int, ...]
    training: tuple[float, ...]
    validation: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The point of lowest validation loss and how it was reached."""

    x: Array
    validation: float
    iterations: int
    status: Status
    trace: Trace


def minimise(
    start: Array,
    value_gradient: Callable[[Array], tuple[float, Array]],
    validation: Callable[[Array], float],
    options: AdamOptions,
    rule: StoppingRule,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Adam until patience runs out; the best validated point is returned.

    Args:
        start: first point.
        value_gradient: loss and gradient, of a fresh mini-batch when it likes.
        validation: loss that decides which point is best.
        options: of Adam.
        rule: of the loop.
        progress: called with iteration and best validation loss at every validation.
    """
    x, state = np.array(start, dtype=float), adam_start(start.size)
    best, best_x, improved_at = validation(x), x.copy(), 0
    trace: list[tuple[int, float, float]] = []
    status, iteration = Status.MAX_ITERATIONS, 0
    if not np.isfinite(best):
        return Outcome(best_x, best, 0, Status.DIVERGED, Trace((), (), ()))
    try:
        for iteration in range(1, rule.max_iterations + 1):
            training, gradient = value_gradient(x)
            state, x = adam_step(state, x, gradient, options)
            if iteration % rule.validate_every == 0:
                loss = validation(x)
                if not np.isfinite(loss):
                    status = Status.DIVERGED
                    break
                trace.append((iteration, training, loss))
                if loss < best - rule.threshold:
                    best, best_x, improved_at = loss, x.copy(), iteration
                if progress is not None:
                    progress(iteration, best)
            if iteration - improved_at >= rule.patience:
                status = Status.PATIENCE
                break
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    columns = zip(*trace, strict=True) if trace else ((), (), ())
    return Outcome(best_x, best, iteration, status, Trace(*(tuple(c) for c in columns)))
