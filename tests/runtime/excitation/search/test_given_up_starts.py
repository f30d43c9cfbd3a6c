"""Starts of a smooth criterion that are warm or given up: rounds, rule, printed sentence."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from runtime.cli.budget import search_notes
from runtime.excitation import design
from runtime.excitation.search import single_start
from runtime.excitation.search.information import information
from runtime.excitation.search.single_start import BEHIND, Search, SearchProblem
from runtime.excitation.search.variations import FEWEST, FIRST, PARENTS, behind_count, rounds
from runtime.library import Library

SMALL = {"duration": 4.0, "harmonics": 3, "criterion": "mixed"}


def problem(lib: Library) -> SearchProblem:
    return SearchProblem(
        *(lib.folder, lib.level, lib.home, SMALL["harmonics"], SMALL["duration"], 0),
        criterion="mixed",
        information=information(lib, 0.05, 100.0),
    )


def counted_steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Largest numbers of steps of all descents from now on; starts are compared after 5 steps."""
    steps: list[int] = []
    descend = single_start.descend

    def counted(*given: Any, **options: Any) -> Any:
        steps.append(given[3])
        return descend(*given, **options)

    monkeypatch.setattr(single_start, "descend", counted)
    monkeypatch.setattr(single_start, "TRIED", 5)  # an arm of two joints converges in 20 steps
    return steps


def test_rounds_of_a_smooth_criterion() -> None:
    """Property: random starts in rounds that grow, then as many near the best so far."""
    ended = {k: (2.0 - k / 100, np.full((1, 1), float(k))) for k in range(32)}
    tasks = list(rounds("mixed", 32, ended))
    assert [len(one) for one in tasks] == [FIRST, FIRST, 4, 4, 4, 4, 4]
    assert [task.number for one in tasks for task in one] == list(range(32))
    assert {task.best for task in tasks[0]} == {np.inf}
    assert {task.best for one in tasks[1:] for task in one} == {ended[31][0]}
    assert [bool(one[0].parents) for one in tasks] == [False] * 3 + [True] * 4
    assert [float(a[0, 0]) for a in tasks[-1][0].parents] == [*range(31, 31 - PARENTS, -1)]
    few = list(rounds("mixed", FEWEST - 1, ended))
    assert [len(one) for one in few] == [FIRST, FEWEST - 1 - FIRST]
    assert not any(task.parents for one in few for task in one)


def test_a_warm_start_is_near_a_good_one(double: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: D-optimality is skipped, limits hold, the number decides, the rule applies."""
    search = Search(double, problem(double))
    best, a = search.start(0)
    steps = counted_steps(monkeypatch)
    for number in range(3):  # one joint, noise, noise
        value, near = search.variation(number, (a,), best + 1.0)
        assert value == search.value(near) < best + 1.0
        assert max(use.max() for use in search.limits.use(near).values()) <= 1 + 1e-9  # rounding
        again, _ = search.variation(number, (a,), best + 1.0)
        assert again == value
    assert steps == [5, 245] * 6
    steps.clear()
    search.variation(0, (a,), best - 1.0)
    assert steps == [5]


def test_a_start_is_given_up_behind_the_best(
    double: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: above the bound it ends early, below it goes on to the same end."""
    search = Search(double, problem(double))
    steps = counted_steps(monkeypatch)
    whole, _ = search.start(0)
    far, a = search.start(0, best=whole - 1.0)
    near, _ = search.start(0, best=whole + 1.0)
    assert steps == [100, 250, 100, 5, 100, 5, 245]
    assert far == search.value(a)
    assert near < far
    assert near == pytest.approx(whole, abs=1e-4)  # steps below the tolerance of 1e-6


def test_far_starts_are_counted_and_printed(double: Library) -> None:
    """Property: starts behind the rounds before them are counted, those of the first are not."""
    ended = {k: (1.0, np.zeros((1, 1))) for k in range(8)} | {
        2: (9.0, np.zeros((1, 1))),
        7: (1.0 + BEHIND + 0.01, np.zeros((1, 1))),
    }
    assert behind_count("mixed", 8, ended) == 1
    assert behind_count("cond", 8, ended) == 0
    known = information(double, 0.05, 100.0)
    alone = design(double, **SMALL, starts=8, seed=1, information=known)
    assert len(alone.values) == 8
    notes = search_notes(alone, None, 8)
    assert len(notes) == (alone.behind > 0)
    if notes:
        assert notes[0].startswith(f"given up: {alone.behind} of 8 starts, more than 5 % above")
    one = replace(alone, conditions=alone.conditions[:1])
    assert search_notes(one, 2.0, 8)[0] == (
        "budget of 2 s: 1 of 8 starts; the first start is made in full however long it takes"
    )
    assert search_notes(one, None, 8)[0] == "interrupted: 1 of 8 starts"
