"""Least squares with some of the columns of a factor."""

import numpy as np
import pytest
from scipy.linalg import lstsq

from runtime.estimators.choice.friction_choice import solved
from runtime.estimators.regression.factor import Statistics
from runtime.library import Array

BASE, OTHERS = 5, 9


def statistics_of(rng: np.random.Generator) -> Statistics:
    """A random factor whose columns differ in length by up to 1e8."""
    size = BASE + OTHERS
    factor = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(-4, 4, size)
    return Statistics(factor, rng.normal(size=size), 0.0, 1.0, np.zeros((BASE, 10)), "")


def by_pivots(statistics: Statistics) -> Array:
    """Least squares of columns of length one, of least length, by a complete factorisation."""
    matrix, lengths = statistics.unit_columns()
    return lstsq(matrix, statistics.target, cond=1e-9, lapack_driver="gelsy")[0] / lengths


@pytest.mark.parametrize("seed", range(5))
def test_solution_is_that_of_pivots(seed: int) -> None:
    """Oracle: least squares by a factorisation with pivots, for code by singular values."""
    rng = np.random.default_rng(seed)
    statistics, left_out = statistics_of(rng), rng.random(OTHERS) < 0.5
    part = statistics.without(left_out)
    wanted = by_pivots(part)
    wanted[BASE:][left_out] = 0.0  # columns of zeros: 1e-16 × any length
    x, rank = solved([part])
    assert rank == BASE + OTHERS - left_out.sum()
    assert not x[BASE:][left_out].any()
    # Rounding 1e-16 × condition of the columns at length one, below 1e3 for these seeds.
    _, lengths = statistics.unit_columns()
    assert np.abs((x - wanted) * lengths).max() < 1e-12 * np.abs(wanted * lengths).max()


@pytest.mark.parametrize("distance", [0.0, 1e-7])
def test_dependent_columns_are_solved_as_by_pivots(distance: float) -> None:
    """Oracle: (nearly) equal columns give the solution of least length of another factorisation."""
    rng = np.random.default_rng(1)
    statistics = statistics_of(rng)
    factor = statistics.factor
    factor[:, -1] = factor[:, -2] * (1 + distance * rng.normal(size=len(factor)))
    (x, rank), (_, lengths) = solved([statistics]), statistics.unit_columns()
    wanted = by_pivots(statistics)
    assert rank == BASE + OTHERS - 1
    # Rounding 1e-16 × condition below 1e3, and what the columns differ by.
    least = 1e-12 + 0.1 * distance
    assert np.abs((x - wanted) * lengths).max() < least * np.abs(wanted * lengths).max()


def test_exact_rows_leave_rounding() -> None:
    """Property: without noise the residual is rounding of the target."""
    statistics = statistics_of(np.random.default_rng(3))
    statistics.target[:] = statistics.factor @ np.ones(BASE + OTHERS)
    x, _ = solved([statistics])
    rest = statistics.factor @ x - statistics.target
    assert np.linalg.norm(rest) < 1e-14 * np.linalg.norm(statistics.target)


def test_column_of_zeros() -> None:
    """Property: a column of zeros gets zero and changes nothing else."""
    statistics = statistics_of(np.random.default_rng(2))
    without = solved([statistics.without(np.arange(OTHERS) == 3)])[0]
    statistics.factor[:, BASE + 3] = 0.0
    x = solved([statistics])[0]
    assert x[BASE + 3] == 0.0
    assert np.allclose(x, without, rtol=1e-12, atol=0)  # the same columns and the same steps
