"""The loop of every optimiser: init, step, status, until the status states why to stop.

An optimiser is an object with three methods (`Optimiser`); its state is an `Iterate`. The loop
counts steps, catches Ctrl-C and calls an observer after each step, such as early stopping on
validation samples (`descend_validated`).

Adam (Kingma & Ba 2015): m, v ← moving averages of g, g²; x ← x − η m̂ / (√v̂ + ε). Source: document
Eqs. 4.42–4.46; ε stands outside the square root.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Adam", "Status", "descend_validated"]

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


def run(
    optimiser: Optimiser[S],
    start: Array,
    max_iterations: int,
    observe: Callable[[int, S], Status | None] | None = None,
) -> tuple[S, int, Status]:
    """Step until the optimiser, the observer or the limit ends it; Ctrl-C ends it, too."""
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


@dataclass(frozen=True, slots=True)
class AdamOptions:
    """η, β₁, β₂, ε; a data class, whose names are keys of saved settings."""

    learning_rate: float = 1e-3
    beta1: float = 0.9
    beta2: float = 0.999
    epsilon: float = 1e-8


@dataclass(frozen=True, slots=True)
class AdamState:
    """First and second moment and the number of steps taken."""

    m: Array
    v: Array
    step: int


@dataclass(frozen=True, slots=True)
class AdamIterate:
    """A point, the loss of the point before it, and the moments."""

    x: Array  # (size,)
    loss: float  # of the point that the last step began with; NaN before the first step
    moments: AdamState  # first and second moment


@dataclass(frozen=True, slots=True)
class Adam:
    """Adam as an `Optimiser`."""

    # loss and gradient (size,) at x; it may draw a mini-batch at each call
    value_gradient: Callable[[Array], tuple[float, Array]]
    options: AdamOptions  # step size and decay of the moments

    def init(self, x: Array) -> AdamIterate:
        """Zero moments at the first point, (size,)."""
        return AdamIterate(np.array(x, dtype=float), np.nan, adam_start(x.size))

    def step(self, state: AdamIterate) -> AdamIterate:
        """One step along the moments of the gradient at the present point."""
        loss, gradient = self.value_gradient(state.x)
        moments, x = adam_step(state.moments, state.x, gradient, self.options)
        return AdamIterate(x, loss, moments)

    def status(self, state: AdamIterate) -> Status | None:
        """None: a stochastic gradient shows no end; validation does."""
        del state
        return None


def adam_start(size: int) -> AdamState:
    """Zero moments of `size` unknowns."""
    return AdamState(np.zeros(size), np.zeros(size), 0)


def adam_step(
    state: AdamState, x: Array, gradient: Array, options: AdamOptions
) -> tuple[AdamState, Array]:
    """Moments and point after one step: x (size,), gradient (size,)."""
    step = state.step + 1
    m = options.beta1 * state.m + (1 - options.beta1) * gradient
    v = options.beta2 * state.v + (1 - options.beta2) * gradient**2
    # The moments start at zero; dividing by 1 − βᵏ removes that bias.
    m_hat = m / (1 - options.beta1**step)
    v_hat = v / (1 - options.beta2**step)
    moved = x - options.learning_rate * m_hat / (np.sqrt(v_hat) + options.epsilon)
    return AdamState(m, v, step), moved


@dataclass(frozen=True, slots=True)
class LevenbergOptions:
    """Settings of a descent by Levenberg–Marquardt."""

    max_iterations: int = 200  # steps tried, accepted or not
    first_damping: float = 1e-8  # μ at the start, relative to the largest squared column of J
    step_tolerance: float = 1e-12  # stop when ‖δ‖ falls below this fraction of ‖x‖
    # stop when a step lowers L by less than this fraction, as predicted
    decrease_tolerance: float = 1e-12
