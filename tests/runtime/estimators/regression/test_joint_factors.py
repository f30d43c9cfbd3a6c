"""Factors of rows whose joints use a part of the columns each."""

import numpy as np
import pytest

from runtime.estimators.regression.posterior import basis_of_joints, triangle_of_joints


@pytest.mark.parametrize("count", [1, 40])
def test_triangle_and_basis_of_joints_are_those_of_all_rows(count: int) -> None:
    """Oracle: the Gram matrix of the dense rows, and the sums of squares of the dense basis.

    The tolerance is rounding over the sums of some ten products.
    """
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(count, 3, 7))
    rows[:, 0, 3:], rows[:, 1, :2], rows[:, 2, 1:6] = 0.0, 0.0, 0.0
    rows[:, :, 6] = 0.0  # used by no joint
    flat = rows.reshape(-1, 7)
    triangle = triangle_of_joints(rows)
    assert triangle.shape == (7, 7)
    np.testing.assert_allclose(triangle, np.triu(triangle))
    np.testing.assert_allclose(triangle.T @ triangle, flat.T @ flat, atol=1e-12)
    for root in (rng.normal(size=(7, 6)), rng.normal(size=(7, 2))):
        basis, dense = basis_of_joints(rows, root), rows @ root
        assert basis.shape[2] == min(4, root.shape[1])
        for mine, other in zip(basis.swapaxes(0, 1), dense.swapaxes(0, 1), strict=True):
            np.testing.assert_allclose(mine @ mine.T, other @ other.T, atol=1e-12)
