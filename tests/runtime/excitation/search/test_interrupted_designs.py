"""Designs by several processes, interrupted, out of time: the best start so far is kept."""

import multiprocessing
import os

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.excitation import ConditionCost
from runtime.excitation.search.design import design
from runtime.library import Library


def test_the_number_of_processes_does_not_matter(lib: Library) -> None:
    """Property: on two processes the same design to the bit; all starts told, the best so far."""
    reports: list[tuple[int, float, float]] = []
    alone = design(lib, duration=4.0, harmonics=2, starts=5, seed=3)
    together = design(
        lib,
        duration=4.0,
        harmonics=2,
        starts=5,
        seed=3,
        processes=2,
        progress=lambda *now: reports.append(now),
    )
    assert np.array_equal(alone.trajectory.coefficients, together.trajectory.coefficients)
    assert alone.conditions == together.conditions
    assert [done for done, _, _ in reports] == [1, 2, 3, 4, 5]
    assert sorted(condition for _, condition, _ in reports) == sorted(alone.conditions)
    best = np.minimum.accumulate([condition for _, condition, _ in reports])
    assert [now for _, _, now in reports] == list(best)


def test_interrupting_processes_keeps_the_best_start(lib: Library) -> None:
    """Property: Ctrl-C stops the workers, keeps what has ended and the order of the starts."""
    reports: list[float] = []

    def stop(done: int, condition: float, _: float) -> None:
        reports.append(condition)
        if done == 3:
            raise KeyboardInterrupt

    kept = design(lib, duration=4.0, harmonics=2, starts=1000, processes=2, progress=stop)
    assert sorted(kept.conditions) == sorted(reports)
    assert len(reports) == 3
    assert not multiprocessing.active_children()
    everything = design(lib, duration=4.0, harmonics=2, starts=5).conditions
    order = [everything.index(condition) for condition in kept.conditions]
    assert order == sorted(order)


def _die(_: object) -> None:
    os._exit(1)


def test_a_worker_that_dies_is_reported(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: one sentence instead of a wait for ever."""
    monkeypatch.setattr("runtime.excitation.search.workers._start", _die)
    with pytest.raises(
        IdentificationError, match="a process of the search ended unexpectedly; give processes=1"
    ):
        design(lib, duration=4.0, harmonics=2, starts=3, processes=2)


def test_no_processes_are_reported(lib: Library) -> None:
    """Property: one sentence."""
    with pytest.raises(IdentificationError, match="at least one process, got 0"):
        design(lib, processes=0)


def test_interrupting_keeps_the_best_start(lib: Library) -> None:
    """Property: Ctrl-C after two of many starts gives the better of two; before one, nothing."""
    reports: list[tuple[int, float, float]] = []

    def stop(done: int, condition: float, best: float) -> None:
        reports.append((done, condition, best))
        if done == 2:
            raise KeyboardInterrupt

    kept = design(lib, duration=4.0, harmonics=2, starts=1000, progress=stop)
    assert [done for done, _, _ in reports] == [1, 2]
    assert kept.conditions == tuple(condition for _, condition, _ in reports)
    assert reports[-1][2] == min(kept.conditions)
    complete = design(lib, duration=4.0, harmonics=2, starts=2)
    assert np.array_equal(kept.trajectory.coefficients, complete.trajectory.coefficients)


def test_a_budget_ends_the_search(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: searches of 10 s each in 35 s are three; the first one is always made."""
    clock = [0.0]
    monkeypatch.setattr("runtime.excitation.search.design.time.monotonic", lambda: clock[0])

    def later(*_: float) -> None:
        clock[0] += 10.0

    for budget, count in ((35.0, 3), (1.0, 1)):
        clock[0] = 0.0
        made = design(lib, duration=4.0, harmonics=2, starts=9, progress=later, budget=budget)
        assert len(made.conditions) == count
    complete = design(lib, duration=4.0, harmonics=2, starts=1)
    assert np.array_equal(made.trajectory.coefficients, complete.trajectory.coefficients)
    with pytest.raises(IdentificationError, match="expected a budget above 0 s, got -1"):
        design(lib, duration=4.0, harmonics=2, starts=1, budget=-1.0)


def test_interrupting_before_the_first_start(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: with nothing to keep, the interruption passes on."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ConditionCost, "value_gradient", interrupt)
    with pytest.raises(KeyboardInterrupt):
        design(lib, duration=4.0, harmonics=2, starts=2)
