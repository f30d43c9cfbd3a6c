"""Poses of the frames of a `Chain`: joint by joint, of all links, and of the tip."""

from dataclasses import dataclass

import casadi as ca

from symgen.chain import Chain, Joint
from symgen.chain.joint import FLOATING
from symgen.kernel import Matrix
from symgen.mechanics.coordinates import all_positions, per_joint
from symgen.mechanics.spatial import axis_rotation, exp_so3


@dataclass(frozen=True, slots=True)
class Pose:
    """R and p of a frame in its parent's frame, and the joint axis in the frame itself."""

    rotation: Matrix
    translation: Matrix
    axis: Matrix


def joint_pose(joint: Joint, q: Matrix) -> Pose:
    """Pose of a joint's frame in its parent's frame.

    Args:
        joint: revolute, continuous, prismatic or floating joint.
        q: joint position, rad or m; of a free base (6,) position [m] and rotation vector [rad].

    Returns:
        Rotation, translation (m) and joint axis.
    """
    rotation, translation = ca.SX(ca.DM(joint.rotation)), ca.SX(ca.DM(joint.translation))
    axis = ca.DM(joint.axis)
    if joint.kind == FLOATING:
        return Pose(exp_so3(q[3:]), q[:3], axis)
    if joint.kind == "prismatic":
        return Pose(rotation, translation + ca.mtimes(rotation, axis) * q, axis)
    return Pose(ca.mtimes(rotation, axis_rotation(axis, q)), translation, axis)


def joint_poses(chain: Chain, q: Matrix) -> list[Pose]:
    """Pose of every joint's frame in its parent's frame.

    Args:
        chain: n independent joints, L bodies.
        q: (n,) joint positions [rad, m].

    Returns:
        L poses.
    """
    positions = per_joint(chain, all_positions(chain, q))
    return [joint_pose(joint, x) for joint, x in zip(chain.joints, positions, strict=True)]


def end_effector(chain: Chain, q: Matrix) -> Matrix:
    """Pose of the tip frame in the base frame.

    Args:
        chain: n independent joints and the tip frame.
        q: (n,) joint positions [rad, m].

    Returns:
        (4, 4) homogeneous matrix [R p; 0 1].
    """
    frames = joint_poses(chain, q)
    rotation = ca.SX(ca.DM(chain.tip.rotation))
    translation = ca.SX(ca.DM(chain.tip.translation))
    index = chain.tip.joint
    while index >= 0:
        pose = frames[index]
        translation = pose.translation + ca.mtimes(pose.rotation, translation)
        rotation = ca.mtimes(pose.rotation, rotation)
        index = chain.joints[index].parent
    bottom = ca.SX(ca.DM([[0, 0, 0, 1]]))
    return ca.vertcat(ca.horzcat(rotation, translation), bottom)


def link_poses(chain: Chain, q: Matrix) -> Matrix:
    """Poses of all joint frames in the base frame.

    Args:
        chain: n independent joints, L bodies.
        q: (n,) joint positions [rad, m].

    Returns:
        (4 L, 4) homogeneous matrices [R p; 0 1], one below the other.
    """
    frames = joint_poses(chain, q)
    poses: list[Matrix] = []
    bottom = ca.SX(ca.DM([[0, 0, 0, 1]]))
    for i, joint in enumerate(chain.joints):
        pose = frames[i]
        step = ca.vertcat(ca.horzcat(pose.rotation, pose.translation), bottom)
        poses.append(step if joint.parent < 0 else ca.mtimes(poses[joint.parent], step))
    return ca.vertcat(*poses)
