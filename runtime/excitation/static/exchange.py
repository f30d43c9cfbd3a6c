"""A-optimal choice of K among many candidates by exchange: min tr (Σ_k Y_kᵀ Y_k)⁻¹.

One pose after another is replaced by the candidate that lowers the trace most, until no exchange
lowers it. The result is a local optimum; several random starts are made.
Source: Fedorov, Theory of Optimal Experiments, 1972, ch. 3.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.library import Array

RIDGE = 1e-9
"""Information added to every unknown, over the mean one: sets that lack one stay comparable."""
GAIN = 1e-6
"""Relative decrease of the trace below which an exchange does not count."""
SWEEPS = 30
"""Largest number of sweeps over all poses; usually six are enough."""


def trace_of(grams: Array, ridge: float) -> Array:
    """Trace of the inverse information."""
    inverse = np.linalg.inv(grams + ridge * np.eye(grams.shape[-1]))
    return np.asarray(np.trace(inverse, axis1=-2, axis2=-1))


def a_optimal(
    grams: Array, count: int, starts: int, rng: np.random.Generator
) -> tuple[NDArray[np.intp], float]:
    """Choose candidates with the least trace of the inverse information.

    grams (C, r, r) → (K,).
    """
    ridge = RIDGE * float(np.trace(grams.mean(axis=0))) / grams.shape[-1]
    best, least = np.arange(count), np.inf
    for _ in range(starts):
        chosen = rng.choice(len(grams), count, replace=False)
        value = _exchanged(grams, chosen, ridge)
        if value < least:
            best, least = chosen, value
    return best, least


def _exchanged(grams: Array, chosen: NDArray[np.intp], ridge: float) -> float:
    """Exchange in place until no exchange lowers the trace; the trace."""
    value = float(trace_of(grams[chosen].sum(axis=0), ridge))
    for _ in range(SWEEPS):
        before = value
        for place in range(len(chosen)):
            others = grams[np.delete(chosen, place)].sum(axis=0)
            values = trace_of(others + grams, ridge)
            values[np.delete(chosen, place)] = np.inf  # a pose is visited once
            other = int(np.argmin(values))
            if values[other] < value * (1 - GAIN):
                chosen[place], value = other, float(values[other])
        if value > before * (1 - GAIN):
            break
    return value
