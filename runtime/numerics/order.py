"""Order statistics of numbers: median and quantiles, to the bit those of NumPy.

`numpy.median` and `numpy.quantile` import the masked arrays of NumPy, 20 ms, to test for one.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from runtime.numerics import Array


def median(values: ArrayLike, axis: int | None = None) -> NDArray[np.float64]:
    """Median, NaN where a value is NaN."""
    whole, axis = (np.ravel(values), 0) if axis is None else (np.asarray(values), axis)
    count = whole.shape[axis]
    places = (count - 1) // 2, count // 2
    # NaN counts as the largest number, so the last place shows whether there is one.
    ordered = np.partition(whole, (*places, count - 1), axis=axis)
    middle = ordered.take(range(places[0], places[1] + 1), axis=axis).mean(axis=axis)
    return np.asarray(np.where(np.isnan(ordered.take(-1, axis=axis)), np.nan, middle))


def quantile(values: Array, share: float) -> float:
    """Quantile of a sample by linear interpolation."""
    last = len(values) - 1
    place = last * share
    low, high = int(place), min(int(place) + 1, last)
    ordered = np.partition(values, (low, high, last))
    if np.isnan(ordered[-1]):
        return float("nan")
    left, right, part = float(ordered[low]), float(ordered[high]), place - low
    # From the nearer end, as NumPy does, so that equal neighbours give their value.
    return left + (right - left) * part if part < 0.5 else right - (right - left) * (1.0 - part)
