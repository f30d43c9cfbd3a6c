"""Pose of one joint's frame in the frame of its parent."""

from dataclasses import dataclass

import casadi as ca

from symgen.chain import Joint
from symgen.chain.model import FLOATING
from symgen.kernel import Matrix
from symgen.mechanics.spatial import axis_rotation, exp_so3


@dataclass(frozen=True, slots=True)
class Pose:
    """R and p of a frame in its parent's frame, and the joint axis in the frame itself."""

    rotation: Matrix
    translation: Matrix
    axis: Matrix


def joint_pose(joint: Joint, q: Matrix) -> Pose:
    """Pose of a joint's frame in its parent's frame.

    q (6,) [m].
    """
    rotation, translation = ca.SX(ca.DM(joint.rotation)), ca.SX(ca.DM(joint.translation))
    axis = ca.DM(joint.axis)
    if joint.kind == FLOATING:
        return Pose(exp_so3(q[3:]), q[:3], axis)
    if joint.kind == "prismatic":
        return Pose(rotation, translation + ca.mtimes(rotation, axis) * q, axis)
    return Pose(ca.mtimes(rotation, axis_rotation(axis, q)), translation, axis)
