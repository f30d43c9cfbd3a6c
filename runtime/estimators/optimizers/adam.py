"""Adam (Kingma & Ba 2015): m, v ← moving averages of g, g²; x ← x − η m̂ / (√v̂ + ε).

Source: document Eqs. 4.42–4.46; ε stands outside the square root.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AdamOptions:
    """η, β₁, β₂, ε."""

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


def adam_start(size: int) -> AdamState:
    """Zero moments."""
    return AdamState(np.zeros(size), np.zeros(size), 0)


def adam_step(
    state: AdamState, x: Array, gradient: Array, options: AdamOptions
) -> tuple[AdamState, Array]:
    """The next state and point."""
    step = state.step + 1
    m = options.beta1 * state.m + (1 - options.beta1) * gradient
    v = options.beta2 * state.v + (1 - options.beta2) * gradient**2
    m_hat = m / (1 - options.beta1**step)
    v_hat = v / (1 - options.beta2**step)
    moved = x - options.learning_rate * m_hat / (np.sqrt(v_hat) + options.epsilon)
    return AdamState(m, v, step), moved
