"""Peer: a library whose algorithms compute the same as our kernels."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from bench.batch import Batch
from runtime.library import Array

REGRESSOR = "computeJointTorqueRegressor"


@dataclass(frozen=True, slots=True)
class Contender:
    """One algorithm of a peer for one of our kernels."""

    algorithm: str  # what it is called there
    run: Callable[[int], float]  # (calls) → ns per sample over the batch
    last: Callable[[], Array] | None = None  # answer for the last sample, our order


@dataclass(frozen=True, slots=True)
class Peer:
    """A library, and its algorithms by the name of our kernel."""

    detail: str
    contenders: dict[str, Contender]


def one_by_one(batch: Batch, one: Callable[..., object], *arrays: Array) -> Callable[[int], float]:
    """Times a Python call per sample, the loop included."""
    rows = list(zip(*(list(x) for x in arrays), strict=True))

    def run(calls: int) -> float:
        start = time.perf_counter_ns()
        for _ in range(calls):
            for row in rows:
                one(*row)
        return (time.perf_counter_ns() - start) / (calls * batch.size)

    return run
