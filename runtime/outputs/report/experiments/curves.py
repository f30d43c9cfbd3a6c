"""Check of the shapes of the series of a figure."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LARGEST = 1e100
"""Largest number that is drawn; its square must be finite."""
_LINES = {"band": 3, "loglog": 3}
"""Number of series of one axis, by kind of figure."""


def is_drawable(kind: str, series: Sequence[NDArray[np.float64]], names: Sequence[str]) -> bool:
    """Whether series have the shapes that a kind of figure needs."""
    shapes = [values.shape for values in series]
    sizes = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in series]
    if any(not shape or shape[0] < 1 for shape in shapes) or max(sizes, default=0.0) > LARGEST:
        return False
    if kind in _LINES:
        return len(series) == _LINES[kind] and set(shapes) == {(shapes[0][0],)}
    if kind == "path":
        one = bool(shapes) and shapes[0][1:] in {(3,), (4, 4)}
        return one and bool(np.isfinite(series[0]).all())
    if kind == "motion":
        same = len(set(shapes[1:])) == 1 and len(shapes[-1]) == 2
        return len(series) == 5 and same and shapes[0] == shapes[1][:1]
    return kind != "lines" or _are_curves(shapes, names)


def _are_curves(shapes: Sequence[tuple[int, ...]], names: Sequence[str]) -> bool:
    """Whether all curves share one x, or each one has its own iterations; for one or n joints."""
    if all(name.endswith("iteration") for name in names[::2]):
        pairs = list(zip(shapes[::2], shapes[1::2], strict=False))
        whole = len(shapes) % 2 == 0
    else:
        pairs, whole = [(shapes[0], shape) for shape in shapes[1:]], len(shapes) > 1
    same = len({len(y) for _, y in pairs}) == 1
    return (
        whole and same and all(len(x) == 1 and len(y) in {1, 2} and x[0] == y[0] for x, y in pairs)
    )
