"""Minimum of a function that is known on a geometric sequence."""

from collections.abc import Sequence

import numpy as np

from runtime.numerics import Array


def minimum_on_grid(places: Sequence[float] | Array, losses: Sequence[float] | Array) -> float:
    """Vertex of the parabola over ln x through the smallest loss and its neighbours."""
    best = int(np.argmin(losses))
    if not 0 < best < len(losses) - 1:
        return float(places[best])
    low, middle, high = (float(loss) for loss in losses[best - 1 : best + 2])
    bend = low - 2 * middle + high
    shift = 0.5 * (low - high) / bend if bend > 0 else 0.0
    step = np.log(places[best + 1] / places[best])
    return float(places[best] * np.exp(shift * step))
