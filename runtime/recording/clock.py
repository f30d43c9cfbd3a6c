"""Check of the clock of a recording: instants that increase, in steps that allow derivatives."""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError

SHORTEST_STEP, LATEST = 1e-12, 1e12
"""Bounds of a clock in any unit of time [s]; beyond them derivatives overflow."""


def require_clock(t: NDArray[np.float64]) -> None:
    """Refuse a clock that stands still, goes back or has another unit.

    t (N,) [s].
    """
    steps = np.diff(t)
    near, far = float(steps.min(initial=np.inf)), float(np.abs(t[[0, -1]]).max())
    if not near > 0.0:  # nor where a step is NaN
        backward = np.flatnonzero(~(steps > 0.0))
        i = int(backward[0])
        raise RecordingError(
            f"expected time that increases, but it goes from {t[i]:.9g} s to {t[i + 1]:.9g} s at "
            f"row {i + 1} (and at {backward.size - 1} more); sort the log or cut it into runs"
        )
    if not (near >= SHORTEST_STEP and far <= LATEST):
        raise RecordingError(
            f"expected time in s, up to {LATEST:g} s in steps from {SHORTEST_STEP:g} s, got "
            f"{far:.3g} s and a step of {near:.3g} s; state the unit of time in a recipe"
        )
