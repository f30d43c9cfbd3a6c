"""The residual of an empty run at the instants of the loaded one: what is not the payload's."""

from collections.abc import Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array
from runtime.recording import Recording

LENGTH = 0.1
"""Relative difference of the durations beyond which the runs are not of one trajectory."""
APART = 0.05
"""Largest distance of the positions, as a share of a joint's way; controllers keep within 1 %."""
SMALLEST_WAY = 0.02
"""Ways below this count as this, rad or m."""


def empty_residual(
    loaded: Recording, empty: Recording, residual: Array, names: Sequence[str]
) -> Array:
    """The empty run's residual (N₀, n), taken linearly to the loaded run's instants, (N, n).

    Raises:
        IdentificationError: the runs are of different length, or of different trajectories.
    """
    if abs(empty.duration - loaded.duration) > LENGTH * loaded.duration:
        raise IdentificationError(
            f"the empty run lasts {empty.duration:.3g} s, the loaded one {loaded.duration:.3g} s; "
            "record the same trajectory twice, or leave the empty run out"
        )
    t, t0 = loaded.t - loaded.t[0], empty.t - empty.t[0]

    def at(values: Array) -> Array:
        return np.stack([np.interp(t, t0, column) for column in values.T], axis=1)

    way = np.maximum(np.ptp(loaded.q, axis=0), SMALLEST_WAY)
    apart = np.max(np.abs(at(empty.q) - loaded.q), axis=0) / way
    worst = int(np.argmax(apart))
    if apart[worst] > APART:
        raise IdentificationError(
            f"the empty run takes another way: {names[worst]} is {100 * apart[worst]:.0f} % of its "
            "way apart at the same time; record the same trajectory, started alike, or leave the "
            "empty run out"
        )
    return at(residual)
