"""Curves with as many points as a screen can show; peaks stay."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def thinned(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """Reduce a curve to about `most` points: the smallest and largest value of equal bins.

    A pause of more than ten median steps becomes a gap in the line.

    Args:
        t: (N,) abscissa.
        y: (N,) values.
        most: largest number of points.

    Returns:
        Abscissa and values of the kept points, with NaN at gaps.
    """
    steps = np.diff(t)
    step = np.median(steps) if len(t) > 1 else 0.0
    pauses = np.flatnonzero(steps > 10 * step) + 1
    if len(pauses) > most // 20:
        pauses = pauses[:0]
    pieces_t, pieces_y = [], []
    edges = [0, *pauses, len(t)]
    for start, stop in pairwise(edges):
        kept = start + _envelope(y[start:stop], max(2, most * (stop - start) // len(t)))
        pieces_t += [t[kept], [np.nan]]
        pieces_y += [y[kept], [np.nan]]
    return np.concatenate(pieces_t[:-1]), np.concatenate(pieces_y[:-1])


def _envelope(y: Array, most: int) -> NDArray[np.intp]:
    """Indices of the first, the last, and the smallest and largest value of each bin."""
    count = len(y)
    if count <= most:
        return np.arange(count)
    safe = np.nan_to_num(y)
    bins = max(1, most // 2)
    size = count // bins
    # Rows of equal length; the remainder, shorter than one more row per bin, forms bins as well.
    whole = count // size * size
    rows = safe[:whole].reshape(-1, size)
    first = np.arange(0, whole, size)
    kept = [first + rows.argmin(axis=1), first + rows.argmax(axis=1), np.array([0, count - 1])]
    if whole < count:
        rest = safe[whole:]
        kept.append(whole + np.array([rest.argmin(), rest.argmax()]))
    return np.unique(np.concatenate(kept))
