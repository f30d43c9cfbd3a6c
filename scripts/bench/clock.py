"""Interleaved measurements on a noisy machine: the best of each round, medians over rounds."""

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

import numpy as np

from runtime.library import Array

Key = TypeVar("Key", bound=Hashable)

BURST = 3e5
"""Nanoseconds of one measurement, after one call that is not timed."""
PASSES = 5
"""Measurements per contender and round; the smallest counts, because noise only adds."""


def interleave(
    contenders: Mapping[Key, Callable[[], float]], rounds: int, passes: int = PASSES
) -> dict[Key, Array]:
    """The smallest of `passes` measurements per round, (rounds,) each.

    Everybody is measured once before anybody is measured again, so that what drifts, drifts for
    all; compare numbers of the same round only.
    """
    for measure in contenders.values():
        measure()
    times = {key: np.full(rounds, np.inf) for key in contenders}
    for k in range(rounds):
        for _ in range(passes):
            for key, measure in contenders.items():
                times[key][k] = min(times[key][k], measure())
    return times


def ratio(theirs: Array, ours: Array) -> float:
    """Median over rounds of the ratios of the same round."""
    return float(np.median(theirs / ours))


def burst(run: Callable[[int], float], samples: int) -> Callable[[], float]:
    """`run(calls)` → ns per sample, with as many calls as fill a burst."""
    run(1)  # warms up
    calls = max(1, round(BURST / (run(1) * samples)))

    def once() -> float:
        run(1)
        return run(calls)

    return once
