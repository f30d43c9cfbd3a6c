"""Medians of interleaved measurements: what drifts, drifts for all."""

import statistics
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

Key = TypeVar("Key", bound=Hashable)


def interleave(contenders: Mapping[Key, Callable[[], float]], repeat: int) -> dict[Key, float]:
    """Median of `repeat` measurements each; every round measures everybody once.

    Args:
        contenders: name → a function that measures itself.
        repeat: rounds; one more runs first and is thrown away.
    """
    found: dict[Key, list[float]] = {key: [] for key in contenders}
    for k in range(repeat + 1):
        for key, measure in contenders.items():
            value = measure()
            if k:
                found[key].append(value)
    return {key: statistics.median(values) for key, values in found.items()}


def calls_for(measure: Callable[[int], float], samples: int, burst: float) -> int:
    """How many calls over `samples` fill a burst of `burst` ns, by a first measurement."""
    measure(1)  # warms up
    return max(1, round(burst / (measure(1) * samples)))
