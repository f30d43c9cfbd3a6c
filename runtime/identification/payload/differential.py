"""Residual of an empty run at the instants of the loaded one: torque that is not the payload's."""

from collections.abc import Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array
from runtime.recording import Recording

LENGTH = 0.1
"""Relative difference of the durations above which the runs are not the same trajectory."""
APART = 0.05
"""Largest distance of the positions over the travel of a joint; controllers stay within 1 %."""
LEAST_TRAVEL = 0.02
"""Smallest travel that the distance is related to, rad or m."""


def empty_residual(
    loaded: Recording, empty: Recording, residual: Array, names: Sequence[str]
) -> Array:
    """Interpolate the residual of the empty run at the instants of the loaded one.

    Returns (N, n) [N·m, N].
    """
    if abs(empty.duration - loaded.duration) > LENGTH * loaded.duration:
        raise IdentificationError(
            f"the empty run lasts {empty.duration:.3g} s, the loaded one {loaded.duration:.3g} s; "
            "record the same trajectory twice, or leave the empty run out"
        )
    t, t0 = loaded.t - loaded.t[0], empty.t - empty.t[0]

    def at(values: Array) -> Array:
        return np.stack([np.interp(t, t0, column) for column in values.T], axis=1)

    travel = np.maximum(np.ptp(loaded.q, axis=0), LEAST_TRAVEL)
    apart = np.max(np.abs(at(empty.q) - loaded.q), axis=0) / travel
    worst = int(np.argmax(apart))
    if apart[worst] > APART:
        raise IdentificationError(
            f"the empty run follows another trajectory: {names[worst]} differs by "
            f"{100 * apart[worst]:.0f} % of its travel at the same time; record the same "
            "trajectory from the same start, or leave the empty run out"
        )
    return at(residual)
