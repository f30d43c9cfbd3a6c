"""Friction columns that are rounding: which they are, and recordings without them.

    C_jk is unresolved where 0 < rms C_jk < SHARE max_i rms C_ik,  or  rms C_jk < LEAST rms τ

Along gravity |τ_g| is 1e-17 N·m instead of zero, and a joint at rest has speeds of 1e-12 rad/s. A
coefficient of such a column would be 1e12 and fit the noise of the torque.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from runtime.recording.friction_column import FloatArray
from runtime.recording.recording import Recording

SHARE = 2.0**-16
"""Size relative to the same column of another joint: the resolution of a signal of 16 bits."""
LEAST = 1e-9
"""Size in SI units relative to the torque [N·m, N]: an effect below rounding in single precision
even for a coefficient of ten."""


def unresolved(columns: FloatArray, tau: FloatArray) -> NDArray[np.bool_]:
    """Columns whose values are rounding.

    Args:
        columns: friction columns C, (N, n, k).
        tau: torque, (N, n) [N·m, N], or power, (N, 1) [W].

    Returns:
        A flag per joint and column, (n, k); False for a column of zeros.
    """
    if not columns.size:
        return np.zeros(columns.shape[1:], dtype=bool)
    flat = columns.reshape(len(columns), -1)
    square = np.einsum("ij,ij->j", flat, flat).reshape(columns.shape[1:])  # in one pass
    size = np.sqrt(square / len(columns))
    torque = float(np.sqrt(np.mean(np.square(tau))))
    least = np.maximum(SHARE * size.max(axis=0), LEAST * torque)
    return np.asarray((size > 0) & (size < least))


def without_columns(recording: Recording, left_out: NDArray[np.bool_]) -> Recording:
    """The recording with some friction columns set to zero.

    Args:
        recording: prepared, with columns (N, n, k) or none.
        left_out: a flag per joint and column, (n, k).

    Returns:
        The recording; unchanged where no flag is set.
    """
    if recording.columns is None or not left_out.any():
        return recording
    return recording.replace(columns=np.where(left_out, 0.0, recording.columns))


def left_out_note(
    left_out: NDArray[np.bool_], joints: Sequence[str], names: Sequence[str]
) -> tuple[str, ...]:
    """Sentence that names the columns left out; none where there are none.

    Args:
        left_out: a flag per joint and column, (n, k).
        joints: names of the joints, (n,).
        names: names of the columns, (k,).

    Returns:
        One sentence or none.
    """
    parts = [
        f"{name} of {', '.join(np.array(joints)[left_out[:, k]])}"
        for k, name in enumerate(names)
        if left_out[:, k].any()
    ]
    if not parts:
        return ()
    return (
        f"left out the friction columns {'; '.join(parts)}: their values are rounding, below "
        f"{SHARE:.1e} of the same column of another joint or {LEAST:g} of the torque",
    )
