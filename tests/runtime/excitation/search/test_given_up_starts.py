"""Starts of a smooth criterion that are warm or given up: rounds, rule, printed sentence."""

import inspect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from runtime.cli.excite import search_notes
from runtime.excitation.search import single_start
from runtime.excitation.search.design import (
    FEWEST_DRAWN,
    FEWEST_STARTS,
    FIRST,
    PARENTS,
    SAME,
    WARM_ROUNDS,
    behind_count,
    design,
    random_count,
    rounds,
    task_rounds,
    variation_count,
)
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import information
from runtime.excitation.search.single_start import SMOOTH_TOLERANCE, TRIED, Search
from runtime.excitation.search.sqp import TOLERANCE
from runtime.library import Library

SMALL = {"duration": 4.0, "harmonics": 3, "criterion": "mixed"}


def problem(lib: Library, criterion: str = "mixed") -> DesignSettings:
    known = information(lib, 0.05, 100.0)
    return DesignSettings(**SMALL | {"criterion": criterion, "information": known})


def counted_steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Largest numbers of steps of all descents from now on; compared after 2 and after 4 steps."""
    steps: list[int] = []
    descend = single_start.descend

    def counted(*given: Any, **options: Any) -> Any:
        steps.append(given[3])
        return descend(*given, **options)

    monkeypatch.setattr(single_start, "descend", counted)
    # An arm of two joints converges in 5 to 20 steps.
    monkeypatch.setattr(single_start, "TRIED", ((2, 0.1), (4, 0.05)))
    return steps


def test_rounds_of_a_smooth_criterion() -> None:
    """Property: random starts in rounds that grow, then descents near the best so far."""
    ended = {k: (2.0 - k / 100, np.full((1, 1), 2.0**k)) for k in range(96)}
    tasks = list(rounds("mixed", 32, ended))
    assert [len(one) for one in tasks] == [FIRST, FIRST, 2] + [8, 9, 9, 9, 9] * 2
    assert [task.number for one in tasks for task in one] == list(range(96))
    assert {task.best for task in tasks[0]} == {np.inf}
    assert {task.best for one in tasks[1:] for task in one} == {ended[95][0]}
    assert [bool(one[0].parents) for one in tasks] == [False] * 3 + [True] * WARM_ROUNDS
    assert [np.log2(a[0, 0]) for a in tasks[-1][0].parents] == [*range(95, 95 - PARENTS, -1)]
    few = list(rounds("mixed", FEWEST_STARTS - 1, ended))
    assert [len(one) for one in few] == [FIRST, FIRST, FEWEST_STARTS - 1 - 2 * FIRST]
    assert not any(task.parents for one in few for task in one)


def test_ends_of_one_optimum_are_one_parent() -> None:
    """Property: of ends closer than SAME the best is a parent, unless log cond decides."""
    bases = np.random.default_rng(1).normal(size=(3, 2, 4))
    ended = {}
    for number, share in enumerate((0.0, 0.5 * SAME, 1.5 * SAME)):
        for which, base in enumerate(bases):
            end = base + share * np.linalg.norm(base) * np.eye(2, 4) / np.sqrt(2)
            ended[3 * number + which] = 1.0 + 0.01 * number + 0.1 * which, end
    parents = {
        criterion: list(rounds(criterion, FEWEST_STARTS, ended))[-1][0].parents
        for criterion in ("mixed", "cond")
    }
    kept = [ended[number][1] for number in (0, 6, 1, 7, 2, 8)]
    assert len(parents["mixed"]) == len(kept)
    assert all(np.array_equal(*both) for both in zip(parents["mixed"], kept, strict=True))
    assert len(parents["cond"]) == PARENTS


@pytest.mark.parametrize("criterion", ["mixed", "cond"])
@pytest.mark.parametrize("starts", [1, 3, FEWEST_STARTS - 1, FEWEST_STARTS, 9, 24, 100])
def test_every_start_and_variation_is_in_one_round(criterion: str, starts: int) -> None:
    """Property: rounds follow each other without gaps, none is empty, random starts come first."""
    limits = task_rounds(criterion, starts)
    assert [begin for begin, _ in limits] == [0, *(end for _, end in limits[:-1])]
    assert all(begin < end for begin, end in limits)
    assert limits[-1][1] == starts + variation_count(criterion, starts)
    drawn = random_count(criterion, starts)
    assert any(end == drawn for _, end in limits)
    assert drawn == starts or FEWEST_DRAWN <= drawn < starts


def test_a_warm_start_is_near_a_good_one(double: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: D-optimality is skipped, limits hold, the number decides, the rule applies."""
    search = Search(double, problem(double))
    best, a = search.start(0)
    steps = counted_steps(monkeypatch)
    for number in (0, 1, 4):  # new motions, noise, a mirrored joint
        value, near = search.variation(number, (a,), best + 9.0)
        assert value == search.value(near) < best + 9.0
        assert max(use.max() for use in search.limits.use(near).values()) <= 1 + 1e-9  # rounding
        again, _ = search.variation(number, (a,), best + 9.0)
        assert again == value
    assert steps == [2, 2, 246] * 6
    steps.clear()
    search.variation(0, (a,), best - 1.0)
    assert steps == [2]


def test_a_start_is_given_up_behind_the_best(
    double: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: above the bound it ends early, below it goes on to the same end."""
    search = Search(double, problem(double, "v"))
    steps = counted_steps(monkeypatch)
    whole, _ = search.start(0)
    far, a = search.start(0, best=whole - 1.0)
    near, _ = search.start(0, best=whole + 1.0)
    assert steps == [100, 250, 100, 2, 100, 2, 2, 246]
    assert far == search.value(a)
    assert near < far
    assert near == pytest.approx(whole, abs=SMOOTH_TOLERANCE)


@pytest.mark.parametrize(("criterion", "least"), [("v", SMOOTH_TOLERANCE), ("cond", TOLERANCE)])
def test_only_the_best_descends_to_the_end(
    double: Library, monkeypatch: pytest.MonkeyPatch, criterion: str, least: float
) -> None:
    """Property: starts and variations of a smooth criterion end early, the refinement does not."""
    search, seen = Search(double, problem(double, criterion)), []
    descend = single_start.descend

    def noted(*given: Any, **options: Any) -> Any:
        seen.append(bind(*given, **options).arguments.get("tolerance", TOLERANCE))
        return descend(*given, **options)

    bind = inspect.signature(descend).bind
    monkeypatch.setattr(single_start, "descend", noted)
    best, a = search.start(0)
    search.variation(1, (a,), best)
    assert set(seen) == {least}
    seen.clear()
    search.refined(a)
    assert seen == ([TOLERANCE] if criterion == "v" else [])


def test_the_second_bound_is_closer(double: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: between the bounds a start goes on after the first check and ends at the second."""
    search = Search(double, problem(double))
    steps = counted_steps(monkeypatch)
    monkeypatch.setattr(single_start, "TRIED", ((2, np.inf), (4, -np.inf)))
    search.start(0, best=0.0)
    assert steps == [100, 2, 2]


def test_far_starts_are_counted_and_printed(double: Library) -> None:
    """Property: descents behind the rounds before them are counted, not those of the first."""
    far = TRIED[-1][1]
    ended = {k: (1.0, np.zeros((1, 1))) for k in range(16)} | {
        2: (9.0, np.zeros((1, 1))),
        7: (1.0 + far + 0.01, np.zeros((1, 1))),
        15: (1.0 + far + 0.01, np.zeros((1, 1))),
    }
    assert behind_count("mixed", 8, ended) == 2
    assert behind_count("cond", 8, ended) == 0
    known = information(double, 0.05, 100.0)
    alone = design(double, **SMALL, starts=8, seed=1, information=known)
    assert (len(alone.values), len(alone.variations)) == (8, 16)
    notes = search_notes(alone, None, 8)
    assert len(notes) == (alone.behind > 0)
    if notes:
        assert notes[0] == (
            f"given up: {alone.behind} of 24 starts and variations, behind the best of the rounds "
            "before by more than 10 % after 40 steps or 5 % after 80 steps"
        )
    one = replace(alone, conditions=alone.conditions[:1])
    assert search_notes(one, 2.0, 8)[0] == (
        "budget of 2 s: 1 of 8 starts; the first start is made in full however long it takes"
    )
    assert search_notes(one, None, 8)[0] == "interrupted: 1 of 8 starts"
