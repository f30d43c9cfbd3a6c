"""Least squares with some of the columns of a factor."""

import numpy as np
import pytest

from runtime.estimators.choice import default_friction as module
from runtime.estimators.choice.default_friction import column_solver
from runtime.estimators.choice.friction_choice import solved
from runtime.estimators.regression.factor import Statistics

BASE, OTHERS = 5, 9


def statistics_of(rng: np.random.Generator) -> Statistics:
    """A random factor whose columns differ in length by up to 1e8."""
    size = BASE + OTHERS
    factor = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(-4, 4, size)
    return Statistics(factor, rng.normal(size=size), 0.0, 1.0, np.zeros((BASE, 10)), "")


@pytest.mark.parametrize("seed", range(5))
def test_solution_is_that_of_singular_values(seed: int, monkeypatch) -> None:
    """Oracle: least squares by singular values; a well-conditioned factor needs none."""
    rng = np.random.default_rng(seed)
    statistics, left_out = statistics_of(rng), rng.random(OTHERS) < 0.5
    wanted = solved([statistics.without(left_out)])[0]
    wanted[BASE:][left_out] = 0.0  # columns of zeros: 1e-16 × any length
    monkeypatch.setattr(module, "solved", None)
    x = column_solver(statistics).solution(left_out)
    assert not x[BASE:][left_out].any()
    # Rounding 1e-16 × condition of the columns at length one, below 1e3 for these seeds.
    _, lengths = statistics.unit_columns()
    assert np.abs((x - wanted) * lengths).max() < 1e-12 * np.abs(wanted * lengths).max()


@pytest.mark.parametrize("distance", [0.0, 1e-7])
def test_dependent_columns_are_solved_by_singular_values(distance: float) -> None:
    """Property: (nearly) equal columns give what the singular values give."""
    rng = np.random.default_rng(1)
    statistics = statistics_of(rng)
    factor, none = statistics.factor, np.zeros(OTHERS, dtype=bool)
    factor[:, -1] = factor[:, -2] * (1 + distance * rng.normal(size=len(factor)))
    expected = solved([statistics])[0]
    assert np.array_equal(column_solver(statistics).solution(none), expected)


def test_exact_rows_are_solved_by_singular_values() -> None:
    """Property: without noise candidates differ by rounding only, which stays what it was."""
    statistics, none = statistics_of(np.random.default_rng(3)), np.zeros(OTHERS, dtype=bool)
    statistics.target[:] = statistics.factor @ np.ones(BASE + OTHERS)
    expected = solved([statistics])[0]
    assert np.array_equal(column_solver(statistics).solution(none), expected)


def test_column_of_zeros() -> None:
    """Property: a column of zeros gets zero and changes nothing else."""
    statistics = statistics_of(np.random.default_rng(2))
    left_out = np.arange(OTHERS) == 3
    without = column_solver(statistics).solution(left_out)
    statistics.factor[:, BASE + 3] = 0.0
    x = column_solver(statistics).solution(np.zeros(OTHERS, dtype=bool))
    assert x[BASE + 3] == 0.0
    assert np.allclose(x, without, rtol=1e-12, atol=0)  # the same columns and the same steps
