"""Pose of the base: position and quaternion, a matrix, or roll, pitch and yaw."""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.library.free_base import ROTATION
from runtime.recording.free_base.arrays import numbers_of
from runtime.recording.recording import FloatArray

_SAME = 1e-3
"""Largest difference between two statements of the same pose [m, entries of R]."""
_EULER = ("base_position", "base_rpy")


def pose_of(arrays: dict[str, NDArray], name: str, count: int) -> tuple[FloatArray, FloatArray]:
    """Rotation and position of the base.

    Returns (N, 3, 3) [m].
    """
    missing = [key for key in _EULER if key not in arrays]
    if "base_pose" not in arrays:
        if missing:
            raise RecordingError(
                f"{name} has no motion of the base: expected base_pose, or base_position and "
                f"base_rpy; {missing[0]} is missing"
            )
        return _from_rpy(arrays, name, count)
    rotation, position = _from_pose(arrays, name, count)
    if "base_rpy" not in missing:
        _require_same(np.abs(_rotation(arrays, name, count) - rotation).max(), "base_rpy", name)
    if "base_position" not in missing:
        other = numbers_of(arrays, "base_position", name, (count, 3))
        _require_same(np.abs(other - position).max(), "base_position", name)
    return rotation, position


def _require_same(difference: float, key: str, name: str) -> None:
    if difference > _SAME:
        raise RecordingError(
            f"{name}: base_pose and {key} differ by up to {difference:.2g}; keep the right one"
        )


def _rotation(arrays: dict[str, NDArray], name: str, count: int) -> FloatArray:
    from scipy.spatial.transform import Rotation

    rpy = numbers_of(arrays, "base_rpy", name, (count, 3))
    pitch = float(np.abs(rpy[:, 1]).max())
    if pitch > np.pi:
        raise RecordingError(
            f"{name}: base_rpy reaches a pitch of {pitch:.3g}, expected at most π rad; convert "
            "degrees to rad"
        )
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())


def _from_rpy(arrays: dict[str, NDArray], name: str, count: int) -> tuple[FloatArray, FloatArray]:
    position = numbers_of(arrays, "base_position", name, (count, 3))
    return _rotation(arrays, name, count), position


def _from_pose(arrays: dict[str, NDArray], name: str, count: int) -> tuple[FloatArray, FloatArray]:
    from scipy.spatial.transform import Rotation

    pose = numbers_of(arrays, "base_pose", name, (count, *np.shape(arrays["base_pose"])[1:]))
    if pose.shape[1:] == (4, 4):
        turn, position = pose[:, :3, :3], pose[:, :3, 3]
        error = np.abs(turn @ np.swapaxes(turn, 1, 2) - np.eye(3)).max()
        error = max(error, np.abs(np.linalg.det(turn) - 1.0).max())
    elif pose.shape[1:] == (7,):
        error = np.abs(np.linalg.norm(pose[:, 3:], axis=1) - 1).max()
        if error > ROTATION:
            raise RecordingError(
                f"{name}: the quaternions of base_pose differ from length 1 by up to "
                f"{error:.2g}; expected x y z and the quaternion x y z w"
            )
        turn, position = Rotation.from_quat(pose[:, 3:]).as_matrix(), pose[:, :3]
    else:
        raise RecordingError(
            f"{name}: base_pose needs the shape ({count}, 7) or ({count}, 4, 4), got {pose.shape}"
        )
    if error > ROTATION:
        raise RecordingError(
            f"{name}: base_pose is not a rigid transform (off by {error:.2g}); give R "
            "from the axes of the base to those of the world"
        )
    return np.asarray(turn), position
