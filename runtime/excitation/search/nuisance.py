"""Friction columns that are estimated beside the unknowns, projected out of a regressor.

Least squares on [Y F] has the information R'R over the unknowns of Y, with the rows of every joint

    R_j = Y_j − F_j X_j,        X_j = (F_jᵀF_j)⁻¹ F_jᵀ Y_j,        F_jᵀ R_j = 0,

because the columns F of a joint act on its own torque alone. A function of RᵀR with ∂f/∂R = R S has

    ∂f/∂Y_j = R_j S,        ∂f/∂F_j = −R_j S X_jᵀ.

On a motion out and back the rows of an inertial regressor are even in dq: columns that are odd in
dq are orthogonal to them and drop out.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError, RecordingError
from runtime.library import Array
from runtime.recording import Friction
from runtime.recording.friction import columns
from runtime.recording.settings import COLUMNS, JointMotion

_DIFFERENCE = 1e-6
"""Step of the slope of a column in dq, rad/s: truncation 1e-9 at ε = 0.02, rounding 1e-10."""
_SINGULAR = 1e-12
"""Eigenvalue of the correlation of columns, below which they count as equal, to rounding."""
_PROBE = np.linspace(-2.0, 2.0, 41)[:, None]
"""Speeds at which a column is tested for being odd, rad/s or m/s."""


def require_of_speed(names: tuple[str, ...]) -> None:
    """Refuse columns that are not functions of the speed of a joint."""
    unusable = tuple(name for name in names if name in COLUMNS and not _is_of_speed(name))
    if unusable:
        usable = ", ".join(name for name in COLUMNS if _is_of_speed(name))
        raise IdentificationError(
            "a motion is designed with friction columns that are functions of a joint's speed, got "
            f"{', '.join(unusable)}; choose from {usable}, or none"
        )
    columns(JointMotion(_PROBE), Friction(names))


def _is_of_speed(name: str) -> bool:
    record = COLUMNS[name]
    if record.is_inertial or record.of_motors or record.signals:
        return False
    try:
        record.function(JointMotion(_PROBE), Friction())
    except RecordingError:
        return False
    return True


def even_columns(names: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that are not odd in dq, those that a motion out and back does not separate."""
    values = columns(JointMotion(_PROBE), Friction(names))
    # A sum of two roundings of numbers of size one.
    is_odd = np.abs(values + values[::-1]).max(axis=(0, 1), initial=0.0) < 1e-12
    return tuple(name for name, odd in zip(names, is_odd, strict=True) if not odd)


@dataclass(frozen=True, slots=True)
class Projection:
    """A regressor less its part along friction columns."""

    rows: Array  # R, (K, N, n, k)
    shares: Array  # X, (K, n, m, k)
    slopes: Array  # ∂F/∂dq, (K, N, n, m)
    # A of every joint, (n, N, N) or (1, N, N), which rows and columns have passed; None without
    filtered: Array | None = None

    def seed_of_speed(self, seed: Array) -> Array:
        """Gradient in dq by way of the friction columns.

        seed (K, N, n, k) → (K, N, n).
        """
        along = (seed.transpose(0, 2, 1, 3) @ self.shares.swapaxes(2, 3)).transpose(0, 2, 1, 3)
        if self.filtered is not None:
            along = in_time(self.filtered.transpose(0, 2, 1), along)
        return -np.einsum("ktjm,ktjm->ktj", along, self.slopes)


def in_time(matrix: Array, rows: Array) -> Array:
    """Product of a matrix and rows along time, joint by joint.

    matrix (n, M, N), rows (K, N, n, k) → (K, M, n, k).
    """
    return np.asarray(np.matmul(matrix, rows.transpose(0, 2, 1, 3)).transpose(0, 2, 1, 3))


def projected(
    rows: Array, dq: Array, names: tuple[str, ...], filtered: Array | None = None
) -> Projection:
    """Project friction columns out of a regressor."""
    terms = Friction(names)

    def at(speed: Array) -> Array:
        flat = speed.reshape(-1, speed.shape[-1])
        return columns(JointMotion(flat), terms).reshape(*speed.shape, -1)

    friction = at(dq)
    slopes = (at(dq + _DIFFERENCE) - at(dq - _DIFFERENCE)) / (2 * _DIFFERENCE)
    if filtered is not None:
        friction = in_time(filtered, friction)
    # Joint by joint, with time as the first axis of a matrix: (K, n, N, m) and (K, n, N, k).
    of_joints, friction = rows.transpose(0, 2, 1, 3), friction.transpose(0, 2, 1, 3)
    size = np.sqrt(np.square(friction).sum(axis=2))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    unit = friction * scale[:, :, None]
    gram, cross = unit.swapaxes(2, 3) @ unit, unit.swapaxes(2, 3) @ of_joints
    if len(names) == 1:  # the square of a rounded length is not quite one
        shares = cross / np.where(gram > 0, gram, 1.0)
    else:
        shares = np.linalg.pinv(gram, rcond=_SINGULAR, hermitian=True) @ cross
    rest = (of_joints - unit @ shares).transpose(0, 2, 1, 3)
    return Projection(rest, shares * scale[..., None], slopes, filtered)
