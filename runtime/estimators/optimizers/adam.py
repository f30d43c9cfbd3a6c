"""Adam (Kingma & Ba 2015): m, v ← moving averages of g, g²; x ← x − η m̂ / (√v̂ + ε).

Source: document Eqs. 4.42–4.46; ε stands outside the square root.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.estimators.optimizers.loop import Array
from runtime.estimators.optimizers.status import Status


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
    """A point, the loss of the point before it, and the moments.

    Attributes:
        x: (size,).
        loss: of the point that the last step began with; NaN before the first step.
        moments: first and second moment.
    """

    x: Array
    loss: float
    moments: AdamState

    @property
    def is_new(self) -> bool:
        """Adam accepts every step."""
        return True


@dataclass(frozen=True, slots=True)
class Adam:
    """Adam as an `Optimiser`.

    Attributes:
        value_gradient: loss and gradient (size,) at x; it may draw a mini-batch at each call.
        options: step size and decay of the moments.
    """

    value_gradient: Callable[[Array], tuple[float, Array]]
    options: AdamOptions

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
    """Moments and point after one step.

    Args:
        state: moments before the step.
        x: point before the step, (size,).
        gradient: of the loss at x, (size,).
        options: step size and decay of the moments.

    Returns:
        The moments and the point after the step.
    """
    step = state.step + 1
    m = options.beta1 * state.m + (1 - options.beta1) * gradient
    v = options.beta2 * state.v + (1 - options.beta2) * gradient**2
    # The moments start at zero; dividing by 1 − βᵏ removes that bias.
    m_hat = m / (1 - options.beta1**step)
    v_hat = v / (1 - options.beta2**step)
    moved = x - options.learning_rate * m_hat / (np.sqrt(v_hat) + options.epsilon)
    return AdamState(m, v, step), moved
