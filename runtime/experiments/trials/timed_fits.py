"""Fits with their computing time; an interrupted descent raises KeyboardInterrupt."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from runtime.estimators.descent.adam import Preset, Watch
from runtime.estimators.descent.fit import fit_many
from runtime.estimators.optimizers import Status
from runtime.estimators.problem import Fit, Problem


def stream(seed: int, number: int, which: int) -> np.random.Generator:
    """Random generator of one trial, independent of all other trials and streams."""
    return np.random.default_rng((seed, number, which))


def adam_of_all(
    problems: Sequence[Problem], preset: Preset, threads: int, watch: Watch | None = None
) -> list[tuple[Fit, float]]:
    """Fit λ-Adam to all problems in one C call; its time is divided by iterations."""
    start = time.perf_counter()
    fits = fit_many(problems, preset, threads, watch=watch)
    seconds = time.perf_counter() - start
    _require_uninterrupted(fits)
    each = seconds / max(sum(fit.iterations or 0 for fit in fits), 1)
    return [(fit, each * (fit.iterations or 0)) for fit in fits]


def timed(method: Callable[[Problem], Fit], problem: Problem) -> tuple[Fit, float]:
    """Fit one method to one problem."""
    start = time.perf_counter()
    fit = method(problem)
    seconds = time.perf_counter() - start
    _require_uninterrupted([fit])
    return fit, seconds


def _require_uninterrupted(fits: Sequence[Fit]) -> None:
    if any(fit.status == Status.INTERRUPTED.value for fit in fits):
        raise KeyboardInterrupt
