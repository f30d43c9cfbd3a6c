"""Other conventions of base twist and acceleration, named by comparison with the pose.

    twist = [Rᵀ ṗ; ω],   acceleration = [d(Rᵀ ṗ)/dt; ω̇],   all in axes of the base

Logs often hold ṗ or ω in axes of the world, ω first, the acceleration of the origin
v̇ + ω × v, or what an accelerometer reads, v̇ + ω × v − Rᵀ g. A statement is refused where one of
these is far closer to it than the convention, in the median of the rows.
"""

import numpy as np

from runtime.errors import RecordingError
from runtime.recording.recording import FloatArray

_FAR = 0.1
"""Distance to the convention, relative to the statement, from which others are tried."""
_CLOSER = 0.3
"""Distance to another convention over that to the expected one that names it."""
_UP = np.array([0.0, 0.0, 9.81])
"""What an accelerometer at rest reads, in axes of the world [m/s²]."""


def require_twist(
    given: FloatArray, expected: FloatArray, turn: FloatArray, t: FloatArray, name: str
) -> None:
    """Refuse a twist in another convention.

    given (N, 6), expected (N, 6), turn (N, 3, 3), t (N,) [s].
    """
    linear, angular = expected[:, :3], expected[:, 3:]
    reordered = "has a quaternion w, x, y, z, expected x, y, z, w; reorder its columns"
    # With M = Rᵀ for R, ω from the pose is −R ω, so that the true one is −M ω.
    inverse = "is the pose of the world in the base, expected that of the base in the world; invert"
    others = {reordered: _reordered(turn, t), inverse: -_turned(turn, angular)}
    _require(given[:, 3:], angular, others, f"{name}: base_pose")
    swapped = "holds the other half, expected velocity, then angular velocity; swap the halves"
    _require(
        given[:, :3],
        linear,
        {_WORLD: _turned(turn, linear), swapped: angular},
        f"{name}: base_twist[:, :3]",
    )
    _require(
        given[:, 3:],
        angular,
        {_WORLD: _turned(turn, angular), swapped: linear},
        f"{name}: base_twist[:, 3:]",
    )


def require_acceleration(
    given: FloatArray, expected: FloatArray, twist: FloatArray, turn: FloatArray, name: str
) -> None:
    """Refuse an acceleration in another convention."""
    linear, angular = expected[:, :3], expected[:, 3:]
    swapped = "holds the other half, expected v̇, then ω̇; swap the halves"
    origin = linear + np.cross(twist[:, 3:], twist[:, :3])
    others = {
        "is the acceleration of the origin, expected the derivative of the velocity in axes of "
        "the base; subtract ω × v": origin,
        "is what an accelerometer reads, expected the derivative of the velocity in axes of the "
        "base; add Rᵀ g, g = (0, 0, −9.81), and subtract ω × v": origin
        + _turned(np.swapaxes(turn, 1, 2), np.broadcast_to(_UP, origin.shape)),
        "is the acceleration of the origin in axes of the world, expected the derivative of the "
        "velocity in axes of the base; multiply it by Rᵀ and subtract ω × v": _turned(turn, origin),
        swapped: angular,
    }
    _require(given[:, :3], linear, others, f"{name}: base_acceleration[:, :3]")
    _require(
        given[:, 3:],
        angular,
        {_WORLD: _turned(turn, angular), swapped: linear},
        f"{name}: base_acceleration[:, 3:]",
    )


_WORLD = "is in axes of the world, expected those of the base; multiply it by Rᵀ"


def _reordered(turn: FloatArray, t: FloatArray) -> FloatArray:
    """Angular velocity of the base if its quaternions w, x, y, z were read as x, y, z, w."""
    from scipy.spatial.transform import Rotation

    right = Rotation.from_quat(Rotation.from_matrix(turn).as_quat()[:, [1, 2, 3, 0]]).as_matrix()
    spin = np.swapaxes(right, 1, 2) @ np.gradient(right, t, axis=0)
    return np.asarray(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1))


def _require(
    given: FloatArray, expected: FloatArray, others: dict[str, FloatArray], what: str
) -> None:
    far, size = _distance(given, expected), _distance(given, np.zeros_like(given))
    if far <= _FAR * size:
        return
    for sentence, other in others.items():
        # It explains the statement too, which noise about zero would not be.
        if _distance(given, other) < _CLOSER * min(far, size):
            raise RecordingError(f"{what} {sentence}")


def _distance(one: FloatArray, other: FloatArray) -> float:
    """Median over the rows of the length of the difference."""
    return float(np.median(np.linalg.norm(one - other, axis=1)))


def _turned(turn: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nij,nj->ni", turn, vectors))
