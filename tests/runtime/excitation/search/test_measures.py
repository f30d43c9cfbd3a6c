"""measures and the costs made of them: closed forms, bounds and gradients."""

import numpy as np
import pytest

from runtime.excitation import ConditionCost, Trajectory, log_condition
from runtime.excitation.search.criteria import (
    d_optimal,
    log_variance,
    log_variances,
    schatten,
    weighted,
)
from runtime.excitation.search.information import SpectralFunction, log_cond, normalised, of_rows
from runtime.library import Library
from tests.taylor import assert_second_order, taylor_slope

DURATION, HARMONICS = 10.0, 5
CRITERIA = {
    "log cond": log_cond,
    "d-optimal": d_optimal,
    "schatten 8": schatten(8.0),
    "schatten 32": schatten(32.0),
}
BY_NAME = pytest.mark.parametrize("criterion", CRITERIA.values(), ids=CRITERIA)


def test_values_by_hand() -> None:
    """Oracle: eigenvalues ½ and 3/2 worked out by hand; all ones are worth nothing."""
    values = np.array([0.5, 1.5])
    assert log_cond(values)[0] == pytest.approx(np.log(3) / 2, rel=1e-14)
    assert d_optimal(values)[0] == pytest.approx(-np.log(0.75) / 4, rel=1e-14)
    expected = np.log((0.5**8 + 1.5**8) * (0.5**-8 + 1.5**-8)) / 16
    assert schatten(8.0)(values)[0] == pytest.approx(expected, rel=1e-14)
    assert log_cond(np.ones(4))[0] == d_optimal(np.ones(4))[0] == 0.0


@pytest.mark.parametrize("power", [1.0, 8.0, 32.0, 1000.0])
def test_schatten_norms_bound_log_cond(power: float) -> None:
    """Property: log cond ≤ Schatten ≤ log cond + log(n)/p, also where λ^p leaves the doubles."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        values = np.sort(np.exp(rng.normal(scale=3.0, size=43)))
        low, value = log_cond(values)[0], schatten(power)(values)[0]
        # Rounding of logarithms of 10.
        assert low - 1e-13 <= value <= low + np.log(43) / power + 1e-13


@BY_NAME
def test_slopes_by_taylor(criterion: SpectralFunction) -> None:
    """Derivative: ∂f/∂λ at eigenvalues that differ."""
    rng = np.random.default_rng(1)
    values = np.sort(rng.uniform(0.5, 2.0, size=6))
    direction = 0.01 * rng.normal(size=6)  # does not change their order
    slope = criterion(values)[1] @ direction
    measured = taylor_slope(lambda x: criterion(x)[0], values, direction, slope)
    assert_second_order(measured, decades=3.5)  # starts at 0.01 and ends at rounding


@BY_NAME
def test_the_length_of_columns_does_not_count(criterion: SpectralFunction) -> None:
    """Property: W and W D with any diagonal D > 0 are worth the same, and S D-homogeneous."""
    rng = np.random.default_rng(2)
    rows, size = rng.normal(size=(30, 5)), np.exp(rng.normal(size=5))
    value, slope = of_rows(rows, criterion)
    scaled_value, scaled_slope = of_rows(rows * size, criterion)
    assert scaled_value == pytest.approx(value, rel=1e-12)
    assert scaled_slope == pytest.approx(slope / np.outer(size, size), rel=1e-9, abs=1e-12)
    assert log_condition(rows)[0] == pytest.approx(
        np.log(np.linalg.cond(rows / np.linalg.norm(rows, axis=0))), rel=1e-12
    )


@BY_NAME
def test_gradients_in_the_coefficients_by_taylor(
    lib: Library, trajectories: tuple[Trajectory, ...], criterion: SpectralFunction
) -> None:
    """Derivative: through correlation, regressor and basis, near a good trajectory."""
    cost = ConditionCost(lib, lib.home, HARMONICS, DURATION)
    a = 0.8 * trajectories[1].coefficients
    direction = a * np.random.default_rng(1).normal(size=a.shape)
    gradient = cost.measure(a, normalised(criterion))[1]
    measured = taylor_slope(
        lambda x: cost.measure(x.reshape(a.shape), normalised(criterion))[0],
        a.ravel(),
        direction.ravel(),
        float(np.sum(gradient * direction)),
    )
    assert_second_order(measured, decades=4.0)  # LAPACK's rounding × cond² ends it earlier


def test_correlations_are_those_of_the_columns(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Oracle: eigenvalues of C give the cost; the diagonal is one; many points are as one."""
    cost = ConditionCost(lib, lib.home, HARMONICS, DURATION)
    a = np.stack([t.coefficients for t in trajectories] * 7)  # more than one chunk
    matrices = cost.correlations(a)
    some, _ = cost.correlations_slopes(a, np.eye(len(lib.base_columns)))
    assert np.array_equal(matrices, some)
    assert np.einsum("kii->ki", matrices) == pytest.approx(1.0, rel=1e-14)
    for matrix, x in zip(matrices, a, strict=True):
        value = log_cond(np.linalg.eigvalsh(matrix))[0]
        # Rounding × cond² of 25.
        assert value == pytest.approx(cost.value_gradient(x)[0], rel=1e-11)


def test_slopes_of_correlations_by_taylor(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Derivative: ⟨F, C(a)⟩ for a random symmetric F, in a batch of more than one chunk."""
    cost = ConditionCost(lib, lib.home, HARMONICS, DURATION)
    rng = np.random.default_rng(4)
    weight = rng.normal(size=(len(lib.base_columns),) * 2)
    weight += weight.T
    a = 0.8 * np.stack([t.coefficients for t in trajectories] * 7)
    slopes = cost.correlations_slopes(a, weight)[1]
    for k in (0, 20):
        direction = a[k] * rng.normal(size=a[k].shape)
        measured = taylor_slope(
            lambda x, k=k: np.sum(weight * cost.correlations(x.reshape(1, *a[k].shape))[0]),
            a[k].ravel(),
            direction.ravel(),
            float(np.sum(slopes[k] * direction)),
        )
        assert_second_order(measured, decades=4.0)  # rounding of sums of 1849 terms ends it


def test_variances_of_one_inverse_are_those_of_several() -> None:
    """Property: the same bits as the weighted sum of single logs; infinite without full rank."""
    root, seen = np.random.default_rng(4).normal(size=(2, 5, 5))
    gram, first, second = root @ root.T, seen @ seen.T, np.eye(5)
    together = log_variances((0.7, first), (0.3, second))
    apart = weighted((0.7, log_variance(first)), (0.3, log_variance(second)))
    assert together(gram)[0] == apart(gram)[0]
    assert np.array_equal(together(gram)[1], apart(gram)[1])
    assert together(np.ones((5, 5)))[0] == np.inf
