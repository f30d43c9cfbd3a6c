"""Curves with as many points as a screen can show; peaks stay."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def pauses(t: Array) -> NDArray[np.intp]:
    """Indices of the first samples after pauses of more than ten median steps."""
    steps = np.diff(t)
    step = np.median(steps) if len(t) > 1 else 0.0
    return np.flatnonzero(steps > 10 * step) + 1


def thinned(
    t: Array, y: Array, most: int, gaps: NDArray[np.intp] | None = None
) -> tuple[Array, Array]:
    """Reduce a curve to about `most` points: the smallest and largest value of equal bins.

    A pause becomes a gap in the line, unless there are too many.
    """
    if gaps is None:
        gaps = pauses(t)
    if len(gaps) > most // 20:
        gaps = gaps[:0]
    pieces_t, pieces_y = [], []
    edges = [0, *gaps, len(t)]
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
