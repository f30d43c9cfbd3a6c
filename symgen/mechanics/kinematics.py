"""Poses of the frames of a `Chain`: joint by joint, of all links, and of the tip."""

import casadi as ca

from symgen.chain import Chain
from symgen.kernel import Matrix
from symgen.mechanics.coordinates import all_positions, per_joint
from symgen.mechanics.pose import Pose, joint_pose


def joint_poses(chain: Chain, q: Matrix) -> list[Pose]:
    """Pose of every joint's frame in its parent's frame.

    q (n,) [rad, m].
    """
    positions = per_joint(chain, all_positions(chain, q))
    return [joint_pose(joint, x) for joint, x in zip(chain.joints, positions, strict=True)]


def end_effector(chain: Chain, q: Matrix) -> Matrix:
    """Pose of the tip frame in the base frame.

    q (n,) [rad, m] → (4, 4) [R p; 0 1].
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

    q (n,) [rad, m] → (4 L, 4) [R p; 0 1].
    """
    frames = joint_poses(chain, q)
    poses: list[Matrix] = []
    bottom = ca.SX(ca.DM([[0, 0, 0, 1]]))
    for i, joint in enumerate(chain.joints):
        pose = frames[i]
        step = ca.vertcat(ca.horzcat(pose.rotation, pose.translation), bottom)
        poses.append(step if joint.parent < 0 else ca.mtimes(poses[joint.parent], step))
    return ca.vertcat(*poses)
