"""Gauss–Newton: minimum, bounded steps, halving and the rules that end the passes."""

import numpy as np
import pytest

from runtime.estimators.gauss_newton import Linearised, gauss_newton
from runtime.estimators.regression.posterior import posterior_of


def rosenbrock(x: np.ndarray) -> Linearised:
    """Residuals 10 (x₂ − x₁²) and 1 − x₁, whose minimum is (1, 1)."""

    def rest(x: np.ndarray) -> np.ndarray:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

    J = np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])
    step = posterior_of(J, -rest(x)).mean
    return Linearised(step, np.ones(2), lambda x: float(rest(x) @ rest(x)))


def line(x: np.ndarray) -> Linearised:
    """A linear problem with its minimum at 3, and an unknown that is not determined."""
    return Linearised(np.array([3.0 - x[0], 7.0]), np.array([0.1, np.nan]))


def test_minimum_with_halved_steps() -> None:
    """Known case: the minimum of Rosenbrock's function, with costs that never rise."""
    solution = gauss_newton(rosenbrock, np.array([-1.2, 1.0]), passes=60, done=1e-9, halvings=30)
    assert solution.converged
    np.testing.assert_allclose(solution.x, 1.0, atol=1e-9)


def test_steps_are_bounded_and_passes_counted() -> None:
    """Closed form: 3 in steps of 1; the small step is taken or left, and NaN does not count."""
    bound = np.array([1.0, 0.0])
    solution = gauss_newton(line, np.zeros(2), passes=9, done=1e-6, most_step=bound)
    assert solution.x.tolist() == [3.0, 0.0]
    assert (solution.converged, solution.passes) == (True, 4)
    short = gauss_newton(line, np.zeros(2), passes=2, done=1e-6, most_step=bound)
    assert (short.x[0], short.converged, short.passes) == (2.0, False, 2)


@pytest.mark.parametrize(("takes_last", "expected"), [(True, 3.0), (False, 2.0)])
def test_whether_the_small_step_is_taken(takes_last: bool, expected: float) -> None:
    """Known cases: ten standard deviations are small enough from 2 on."""
    bound = np.array([1.0, 0.0])
    solution = gauss_newton(
        line, np.zeros(2), passes=9, done=10.0, most_step=bound, takes_last=takes_last
    )
    assert solution.converged
    assert solution.x[0] == expected
