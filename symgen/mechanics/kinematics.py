"""Independent coordinates of a `Chain`, and poses and Jacobians of its frames.

    q_all = A x + b,   x = q or, with loops, x = g(q)
    τ = (A G)ᵀ τ_all,   M = (A G)ᵀ M_all A G,   G = ∂x/∂q

q has n entries, q_all N. The recursions of the other modules run over all joints; these maps lead
in and out of them. Where every joint is independent they return their argument itself, so that no
operation is added.

With a free base the first six entries are its own. q: position of the base in the world [m], and
the rotation vector ω of its axes, R = exp(ω) [rad]. dq: its velocity [m/s] and angular velocity
[rad/s], both in the axes of the base. ddq: the derivatives of these six numbers, so that the
acceleration of the base's origin is ddq_v + ω × v. τ: force [N] and moment [N·m] on the base, in
its axes, about its origin. dq is not the derivative of q there.
"""

import casadi as ca

from symgen.chain import Chain
from symgen.chain.model import BASE_FREEDOM, FLOATING
from symgen.kernel import Matrix
from symgen.mechanics import closure
from symgen.mechanics.spatial import Pose, joint_pose


def per_joint(chain: Chain, values: Matrix) -> list[Matrix]:
    """Entries of each joint: six of a free base, one of every other joint."""
    if not chain.floating:
        return [values[i] for i in range(len(chain.joints))]
    rest = range(BASE_FREEDOM, BASE_FREEDOM + len(chain.joints) - 1)
    return [values[:BASE_FREEDOM], *(values[i] for i in rest)]


def all_positions(chain: Chain, q: Matrix) -> Matrix:
    """q_all = A x + b, (N,) [rad, m]."""
    coupling = chain.coupling
    x = q if chain.loops is None else closure.positions(chain, q)
    if coupling is None:
        return x
    offset = ca.DM(coupling.offset)
    if chain.floating:
        offset = ca.vertcat(ca.DM.zeros(BASE_FREEDOM), offset)
    return ca.mtimes(_matrix(chain), x) + offset


def all_rates(chain: Chain, q: Matrix, dq: Matrix) -> Matrix:
    """A G dq, (N,) [rad/s, m/s]."""
    rate = dq if chain.loops is None else closure.rates(chain, q, dq)
    return rate if chain.coupling is None else ca.mtimes(_matrix(chain), rate)


def all_accelerations(chain: Chain, q: Matrix, dq: Matrix, ddq: Matrix) -> Matrix:
    """A (G ddq + Ġ dq), (N,) [rad/s², m/s²]."""
    rate = ddq if chain.loops is None else closure.accelerations(chain, q, dq, ddq)
    return rate if chain.coupling is None else ca.mtimes(_matrix(chain), rate)


def independent_forces(chain: Chain, q: Matrix, force: Matrix) -> Matrix:
    """(A G)ᵀ τ_all, (N, m) → (n, m): generalised forces by virtual power."""
    if chain.coupling is not None:
        force = ca.mtimes(_matrix(chain).T, force)
    return force if chain.loops is None else closure.forces(chain, q, force)


def independent_mass(chain: Chain, q: Matrix, mass: Matrix) -> Matrix:
    """(A G)ᵀ M_all A G, (N, N) → (n, n), symmetric to the bit."""
    if chain.coupling is None and chain.loops is None:
        return mass
    moved = joint_jacobian(chain, q)
    full = ca.mtimes(moved.T, ca.mtimes(mass, moved))
    upper = ca.triu(full)  # the lower triangle is a copy: sums in another order would differ
    return upper + ca.triu(full, False).T


def joint_jacobian(chain: Chain, q: Matrix) -> Matrix:
    """A G = ∂q_all/∂q, (N, n)."""
    if chain.loops is None:
        return ca.DM.eye(q.numel()) if chain.coupling is None else _matrix(chain)
    inner = closure.jacobian(chain, q)
    return inner if chain.coupling is None else ca.mtimes(_matrix(chain), inner)


def _matrix(chain: Chain) -> Matrix:
    if chain.coupling is None:
        return ca.DM()
    matrix = ca.DM(chain.coupling.matrix)
    return ca.sparsify(ca.diagcat(ca.DM.eye(BASE_FREEDOM), matrix) if chain.floating else matrix)


def joint_poses(chain: Chain, q: Matrix) -> list[Pose]:
    """Pose of every joint's frame in its parent's frame."""
    positions = per_joint(chain, all_positions(chain, q))
    return [joint_pose(joint, x) for joint, x in zip(chain.joints, positions, strict=True)]


def frames_in_base(chain: Chain, q: Matrix) -> list[Pose]:
    """Pose of every joint's frame in the base frame, with the axis of the joint there."""
    placed: list[Pose] = []
    for joint, pose in zip(chain.joints, joint_poses(chain, q), strict=True):
        rotation, origin = pose.rotation, pose.translation
        if joint.parent >= 0:
            before = placed[joint.parent]
            origin = before.translation + ca.mtimes(before.rotation, origin)
            rotation = ca.mtimes(before.rotation, rotation)
        placed.append(Pose(rotation, origin, ca.mtimes(rotation, pose.axis)))
    return placed


def end_effector(chain: Chain, q: Matrix) -> Matrix:
    """Pose [R p; 0 1] of the tip frame in the base frame, (4, 4)."""
    frames = joint_poses(chain, q)
    rotation = ca.SX(ca.DM(chain.tip.rotation))
    translation = ca.SX(ca.DM(chain.tip.translation))
    index = chain.tip.joint
    while index >= 0:
        pose = frames[index]
        translation = pose.translation + ca.mtimes(pose.rotation, translation)
        rotation = ca.mtimes(pose.rotation, rotation)
        index = chain.joints[index].parent
    return ca.vertcat(ca.horzcat(rotation, translation), ca.SX(ca.DM([[0, 0, 0, 1]])))


def link_poses(chain: Chain, q: Matrix) -> Matrix:
    """Poses [R p; 0 1] of all joint frames in the base frame, one below the other, (4 L, 4)."""
    frames = joint_poses(chain, q)
    poses: list[Matrix] = []
    bottom = ca.SX(ca.DM([[0, 0, 0, 1]]))
    for i, joint in enumerate(chain.joints):
        pose = frames[i]
        step = ca.vertcat(ca.horzcat(pose.rotation, pose.translation), bottom)
        poses.append(step if joint.parent < 0 else ca.mtimes(poses[joint.parent], step))
    return ca.vertcat(*poses)


def frame_jacobians(chain: Chain, q: Matrix) -> Matrix:
    """Jacobians of the frames of all links and of the tip, v = J dq, (6 (L + 1), n).

    v is the linear velocity of the frame's origin, then the angular velocity, both in axes of the
    base, with a free base in axes of the world.
    """
    poses = frames_in_base(chain, q)
    frames = [(k, pose.translation) for k, pose in enumerate(poses)]
    tip = ca.SX(3, 1)  # where no joint moves it
    if chain.tip.joint >= 0:
        last = poses[chain.tip.joint]
        tip = last.translation + ca.mtimes(last.rotation, ca.DM(chain.tip.translation))
    frames.append((chain.tip.joint, tip))
    blocks = []
    first = BASE_FREEDOM - 1 if chain.floating else 0  # joint k has column first + k
    for moved, origin in frames:
        jacobian, k = ca.SX(6, first + len(chain.joints)), moved
        while k >= 0:
            kind, pose = chain.joints[k].kind, poses[k]
            lever = origin - pose.translation
            if kind == FLOATING:  # v = R v_b + (R ω_b) × lever, ω = R ω_b
                jacobian[:3, :3] = jacobian[3:, 3:BASE_FREEDOM] = pose.rotation
                jacobian[:3, 3:BASE_FREEDOM] = -ca.mtimes(ca.skew(lever), pose.rotation)
            elif kind == "prismatic":
                jacobian[:3, first + k] = pose.axis
            else:
                jacobian[:3, first + k] = ca.cross(pose.axis, lever)
                jacobian[3:, first + k] = pose.axis
            k = chain.joints[k].parent
        blocks.append(independent_forces(chain, q, jacobian.T).T)  # J A of coupled joints
    return ca.vertcat(*blocks)
