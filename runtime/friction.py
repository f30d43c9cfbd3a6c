"""Joint friction, linear in its parameters: columns of the motion times coefficients.

    τ_f,j = Σ_k C_jk φ_jk      viscous C = dq,   coulomb C = tanh(dq / ε),   offset C = 1,
                               dahl C = z,   dz/dq = (1 − z sign dq) / z_c

tanh stands for the sign of dq and is smooth at rest; ε is the speed below which it gives way.
Columns of a filtered recording are computed from the unfiltered speed and then filtered with the
rest of the data, because the filtered tanh is not the tanh of the filtered speed.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.recipe import COULOMB_SPEED
from runtime.recording.recording import Recording

FloatArray = NDArray[np.float64]

COLUMNS: dict[str, Callable[[FloatArray, float], FloatArray]] = {
    "viscous": lambda dq, _: dq,
    "coulomb": lambda dq, coulomb_speed: np.tanh(dq / coulomb_speed),
    "offset": lambda dq, _: np.ones_like(dq),
    "dahl": lambda dq, coulomb_speed: np.tanh(dq / coulomb_speed),  # after steady motion
}

DAHL_WAY = 2e-3
"""z_c, rad or m: the way after a reversal on which the presliding state forgets, Dahl 1968."""


def dahl_state(q: FloatArray) -> FloatArray:
    """z (N, n) of a path q (N, n): z' = (z + Δq/z_c) / (1 + |Δq|/z_c), implicit, from 0."""
    steps = np.diff(q, axis=0) / DAHL_WAY
    z = np.zeros_like(q)
    for k, step in enumerate(steps):
        z[k + 1] = (z[k] + step) / (1 + np.abs(step))
    return z


def columns(
    dq: FloatArray, names: Sequence[str], coulomb_speed: float = COULOMB_SPEED
) -> FloatArray:
    """C (N, n, k) from dq (N, n) [rad/s]: one column per name, ε = coulomb_speed [rad/s].

    Raises:
        RecordingError: an unknown or repeated name, or a speed that is not above 0.
    """
    for name in names:
        if name not in COLUMNS:
            raise RecordingError(
                f"there is no friction column {name!r}; choose from {', '.join(COLUMNS)}"
            )
    if len(set(names)) < len(names):
        raise RecordingError(
            f"the friction columns {', '.join(names)} name one twice, so that their coefficients "
            "cannot be told apart; name each once"
        )
    if not coulomb_speed > 0.0:
        raise RecordingError(
            f"expected a coulomb_speed above 0 rad/s, got {coulomb_speed}; 0.02 is usual"
        )
    dq = np.asarray(dq, dtype=np.float64)
    if not names:
        return np.zeros((*dq.shape, 0))
    return np.stack([COLUMNS[name](dq, coulomb_speed) for name in names], axis=-1)


def torque(columns: FloatArray, phi: FloatArray) -> FloatArray:
    """τ_f (N, n) [N·m] = Σ_k C[:, :, k] φ[:, k], with φ (n, k) in N·m per unit of the column.

    Raises:
        RecordingError: φ does not have one row per joint and one entry per column.
    """
    columns, phi = np.asarray(columns), np.asarray(phi)
    if columns.shape[-2:] != phi.shape:
        raise RecordingError(
            f"expected φ of shape {columns.shape[-2:]} (joints, columns), got {phi.shape}"
        )
    return np.einsum("...jk,jk->...j", columns, phi)


def add_columns(
    recording: Recording, names: Sequence[str], coulomb_speed: float = COULOMB_SPEED
) -> Recording:
    """The recording with the friction columns of its speed.

    Raises:
        RecordingError: the recording has no dq, or a name is unknown.
    """
    if recording.dq is None:
        raise RecordingError("friction columns expect dq, but there is none; differentiate first")
    values = columns(recording.dq, names, coulomb_speed)
    if "dahl" in names:
        values[..., tuple(names).index("dahl")] = dahl_state(recording.q)
    sentence = f"Added the friction columns {', '.join(names)} (ε = {coulomb_speed:g} rad/s)."
    return recording.replace(columns=values, column_names=tuple(names)).noted(sentence)
