"""Motion of a free base: pose, twist and acceleration, and the coordinates of the kernels.

    q = (p, ω_R, joints)   dq = (v, ω, joint velocities)   ddq = (dv, dω, joint accelerations)

p is the position of the base link's frame in the world and R = exp(ω_R) its axes; v and ω are its
velocity and angular velocity in its own axes, and dv and dω the derivatives of these numbers, as in
Pinocchio's free flyer (LOCAL). The acceleration of the origin, in axes of the base, is dv + ω × v.
Rows of torque are the force and the moment about that origin, in axes of the base, then the joints.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from runtime.errors import ShapeError
from runtime.library.arrays import Array
from runtime.library.manifest import Manifest

FREEDOM = 6  # rows of the base
ROWS = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
"""Names of the rows of the base, in its axes."""


class BaseMotion(NamedTuple):
    """Motion of a free base; one sample or N.

    Attributes:
        pose: (4, 4) homogeneous matrix of the base link's frame in the world, or (7,) position [m]
            and quaternion (x, y, z, w).
        twist: (6,) velocity [m/s] and angular velocity [rad/s], in axes of the base.
        acceleration: (6,) derivatives of the entries of `twist` [m/s², rad/s²].
    """

    pose: ArrayLike
    twist: ArrayLike = (0.0,) * FREEDOM
    acceleration: ArrayLike = (0.0,) * FREEDOM


def coordinates_of_pose(pose: ArrayLike) -> Array:
    """Positions and rotation vectors (6,) [m, rad] of poses (4, 4) or (7,)."""
    turn, position = rotation_and_position(np.asarray(pose, dtype=float))
    return np.concatenate([position, Rotation.from_matrix(turn).as_rotvec()], axis=-1)


def rotation_and_position(array: Array) -> tuple[Array, Array]:
    """R (..., 3, 3) and positions (..., 3) of poses (..., 4, 4) or (..., 7)."""
    is_matrix = array.ndim in {2, 3} and array.shape[-2:] == (4, 4)
    if not is_matrix and not (array.ndim in {1, 2} and array.shape[-1] == 7):
        raise ShapeError(
            "the pose of the base needs the shape (4, 4) or (N, 4, 4), or (7,) or (N, 7) for "
            f"position and quaternion x, y, z, w; got {array.shape}"
        )
    if not np.isfinite(array).all():
        raise ShapeError("the pose of the base has numbers that are not finite; remove these rows")
    if is_matrix:
        rotation, position = array[..., :3, :3], array[..., :3, 3]
        error = np.abs(rotation @ np.swapaxes(rotation, -1, -2) - np.eye(3))
        if error.size and (error.max() > ROTATION or np.linalg.det(rotation).min() < 0):
            raise ShapeError(
                f"the pose of the base is not a rigid transform (R Rᵀ differs from 1 by up "
                f"to {error.max():.1g}); give R from the axes of the base to those of the world"
            )
        return rotation, position
    position, quaternion = array[..., :3], array[..., 3:]
    length = np.linalg.norm(quaternion, axis=-1)
    if length.size and np.abs(length - 1).max() > ROTATION:
        raise ShapeError(
            "the quaternion of the base has another length than 1 "
            f"({length.flat[np.abs(length - 1).argmax()]:.3g}); expected x, y, z, w"
        )
    return np.asarray(Rotation.from_quat(quaternion).as_matrix()), position


def stacked(values: ArrayLike, part: ArrayLike, what: str) -> Array:
    """Six entries of the base before those of the joints, (6 + n,)."""
    array, base = np.asarray(values, dtype=float), np.asarray(part, dtype=float)
    if base.ndim not in {1, 2} or base.shape[-1] != FREEDOM:
        raise ShapeError(f"the {what} of the base needs (6,) or (N, 6) numbers, got {base.shape}")
    if array.ndim == 2 and base.ndim == 1:
        base = np.broadcast_to(base, (len(array), FREEDOM))
    elif array.ndim == 1 and base.ndim == 2:
        array = np.broadcast_to(array, (len(base), len(array)))
    if array.ndim not in {1, 2} or array.shape[:-1] != base.shape[:-1]:
        raise ShapeError(
            f"the {what} of the base has the shape {base.shape}, that of the joints "
            f"{array.shape}; expected equally many samples"
        )
    return np.concatenate([base, array], axis=-1)


def with_base(
    manifest: Manifest, base: BaseMotion | None, *values: ArrayLike
) -> tuple[ArrayLike, ...]:
    """Coordinates of the kernels: those of the joints after those of a free base."""
    robot, n = manifest.robot, len(manifest.joints)
    if not manifest.floating:
        if base is not None:
            raise ShapeError(
                f"the base of '{robot}' is fixed; leave `base` out, or build the robot with "
                "--floating"
            )
        return values
    if base is None:
        if all(np.shape(x)[-1:] == (FREEDOM + n,) for x in values):
            return values
        raise ShapeError(
            f"the base of '{robot}' is free: give base=(pose, twist, acceleration), or values "
            f"of shape (N, {FREEDOM + n}) with the base first"
        )
    motion = BaseMotion(*base)
    parts = (coordinates_of_pose(motion.pose), motion.twist, motion.acceleration)
    names = ("pose", "twist", "acceleration")
    pairs = zip(values, parts, names, strict=False)
    return tuple(stacked(x, part, name) for x, part, name in pairs)


ROTATION = 1e-5  # error of R Rᵀ or a quaternion's length: logs are of single precision
