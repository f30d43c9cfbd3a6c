"""The loop of every optimiser: init, step, status, until the status says why to stop.

An optimiser is an object with three methods (`Optimiser`); its state is an `Iterate`. The loop
counts steps, catches Ctrl-C and calls an observer after each step. Two observers are here: early
stopping on validation samples (`descend_validated`) and a trace down to the end
(`descend_traced`). To add an optimiser: its module with the three methods, and where it is used.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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


class Iterate(Protocol):
    """State of an optimiser between two steps."""

    @property
    def x(self) -> Array:
        """Present point, (size,)."""

    @property
    def loss(self) -> float:
        """Training loss that the last step has evaluated."""

    @property
    def is_new(self) -> bool:
        """Whether the last step has changed x."""


S = TypeVar("S", bound=Iterate)


class Optimiser(Protocol[S]):
    """Three pure functions; an optimiser has no state besides what they return."""

    def init(self, x: Array) -> S:
        """State at the first point, (size,)."""

    def step(self, state: S) -> S:
        """State after one more step, accepted or not."""

    def status(self, state: S) -> Status | None:
        """Why to stop; None to go on."""


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


def run(
    optimiser: Optimiser[S],
    start: Array,
    max_iterations: int,
    observe: Callable[[int, S], Status | None] | None = None,
) -> tuple[S, int, Status]:
    """Step until the optimiser, the observer or the limit ends it; Ctrl-C ends it, too.

    Args:
        optimiser: init, step and status.
        start: first point, (size,).
        max_iterations: limit of steps, accepted or not.
        observe: called after each step with its number and the state; a status ends the loop.

    Returns:
        The last state, the number of steps begun, and why the loop ended.
    """
    state = optimiser.init(start)
    status, iteration = optimiser.status(state), 0
    try:
        while status is None and iteration < max_iterations:
            iteration += 1
            state = optimiser.step(state)
            status = optimiser.status(state)
            if observe is not None:
                status = observe(iteration, state) or status
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    return state, iteration, status or Status.MAX_ITERATIONS


class _EarlyStopping:
    """Observer that validates now and then, keeps the best point and stops without progress."""

    def __init__(
        self,
        start: Array,
        validation: Callable[[Array], float],
        rule: StoppingRule,
        progress: Callable[[int, float], None] | None,
    ) -> None:
        self.validation, self.rule, self.progress = validation, rule, progress
        self.best, self.best_x, self.improved_at = validation(start), start.copy(), 0
        self.rows: list[tuple[int, float, float]] = []

    def __call__(self, iteration: int, state: Iterate) -> Status | None:
        if iteration % self.rule.validate_every == 0:
            loss = self.validation(state.x)
            if not np.isfinite(loss):
                return Status.DIVERGED
            self.rows.append((iteration, state.loss, loss))
            if loss < self.best - self.rule.threshold:
                self.best, self.best_x, self.improved_at = loss, state.x.copy(), iteration
            if self.progress is not None:
                self.progress(iteration, self.best)
        return Status.PATIENCE if iteration - self.improved_at >= self.rule.patience else None


def descend_validated(
    optimiser: Optimiser[S],
    start: Array,
    validation: Callable[[Array], float],
    rule: StoppingRule,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Descend with early stopping; the point of the lowest validation loss is returned.

    Args:
        optimiser: init, step and status.
        start: first point, (size,).
        validation: loss that decides which point is best.
        rule: when to validate and when to stop.
        progress: called with iteration and best validation loss at every validation.

    Returns:
        The best validated point; DIVERGED at once where the start has no finite loss.
    """
    x = np.array(start, dtype=float)
    observer = _EarlyStopping(x, validation, rule, progress)
    if not np.isfinite(observer.best):
        return Outcome(observer.best_x, observer.best, 0, Status.DIVERGED, trace_of(()))
    _, iterations, status = run(optimiser, x, rule.max_iterations, observer)
    trace = trace_of(observer.rows)
    return Outcome(observer.best_x, observer.best, iterations, status, trace)


def descend_traced(
    optimiser: Optimiser[S],
    start: Array,
    validation: Callable[[Array], float],
    max_iterations: int,
    progress: Callable[[int, float], None] | None = None,
) -> Outcome:
    """Descend until the optimiser stops; the last point is returned.

    Args:
        optimiser: init, step and status.
        start: first point, (size,).
        validation: loss that is recorded at every new point; it does not stop the descent.
        max_iterations: limit of steps, accepted or not.
        progress: called with iteration and training loss after every step.

    Returns:
        The last point; its validation loss is ∞ where the training loss is not finite.
    """
    rows: list[tuple[int, float, float]] = []

    def observe(iteration: int, state: S) -> None:
        if state.is_new:
            rows.append((iteration, state.loss, validation(state.x)))
        if progress is not None:
            progress(iteration, state.loss)

    state, iterations, status = run(optimiser, start, max_iterations, observe)
    validated = validation(state.x) if np.isfinite(state.loss) else np.inf
    return Outcome(state.x, validated, iterations, status, trace_of(rows))
