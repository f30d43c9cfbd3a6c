"""Order statistics."""

import numpy as np
import pytest

from runtime.numerics.order import median, quantile


@pytest.mark.parametrize("count", [1, 2, 3, 10, 101])
def test_median_and_quantiles_are_those_of_numpy(count: int) -> None:
    """Oracle: NumPy, to the bit, with equal values, an infinity and a NaN."""
    rng = np.random.default_rng(count)
    table = np.round(rng.normal(size=(count, 4)) * 10 ** rng.uniform(-9, 9, 4), 3)
    table[rng.integers(count), 2], table[rng.integers(count), 3] = np.inf, np.nan
    assert np.array_equal(median(table, axis=0), np.median(table, axis=0), equal_nan=True)
    assert np.array_equal(median(table[:, :2]), np.median(table[:, :2]))
    assert np.array_equal(median(np.arange(count)), np.median(np.arange(count)))
    for share in (0.0, 0.25, 0.3, 0.75, 0.99, 1.0):
        for column in (0, 1, 3):
            expected = np.quantile(table[:, column], share)
            assert np.array_equal(quantile(table[:, column], share), expected, equal_nan=True)
