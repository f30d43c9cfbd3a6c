"""Fits with their computing time; an interrupted descent raises KeyboardInterrupt."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.descent.adam import Preset, Watch
from runtime.estimators.descent.fit import fit_many, fit_of, start_of
from runtime.estimators.optimizers import Adam, Status, descend_validated
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.compression import TorqueObjective
from runtime.library import Array, Library

LINK = 6
"""Index of link 7, from 0."""


def link_rows(lib: Library) -> NDArray[np.bool_]:
    """Mask (10 n,) of the entries of λ that belong to link 7."""
    return np.arange(lib.lam0.size) // (lib.lam0.size // lib.n_links) == LINK


def fit_frozen(problem: Problem, truth: Array, preset: Preset, places: list[Array]) -> Fit:
    """Fit by the descent in NumPy, because the compiled one updates every link."""
    lib, batch = problem.lib, preset.batch or len(problem.train)
    frozen = link_rows(lib)
    weights = np.where(np.arange(lib.n_joints) == LINK, 0.0, problem.weights)
    start = np.where(frozen, truth, problem.start)
    descent = start_of(replace(problem, weights=weights, start=start))
    # Friction coefficients follow λ in x and are never frozen.
    fixed = np.concatenate([frozen, np.zeros(descent.x0.size - frozen.size, dtype=bool)])
    objective, size = descent.objective, len(problem.train)
    held = TorqueObjective(lib, problem.validation, weights, objective.unit)
    rng = np.random.default_rng(problem.seed)

    def value_gradient(x: Array) -> tuple[float, Array]:
        places.append(x)
        loss, slope = objective.value_gradient(x, rng.integers(0, size, batch))
        return loss, np.where(fixed, 0.0, slope)

    outcome = descend_validated(
        Adam(value_gradient, preset.adam), descent.x0, held.value, preset.rule
    )
    return fit_of(descent, outcome)


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
