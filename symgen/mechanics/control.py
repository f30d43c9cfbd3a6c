"""Terms of model-based controllers: C(q, dq) of Christoffel symbols, Slotine–Li, Jacobians.

With c(q, dq) = C dq, quadratic in dq, and Γ symmetric in its last two indices,

    C = ½ ∂c/∂dq,   C(q, dq) x = ½ (∂c/∂dq) x,   dM/dt = C + Cᵀ

so both forms follow from the one recursion of `inverse_dynamics`.
Source: Siciliano et al., Robotics, 2009, eqs. 7.44–7.47; Slotine & Li, IJRR 6(3), 1987.
"""

import casadi as ca

from symgen.chain import Chain
from symgen.chain.model import BASE_FREEDOM, FLOATING
from symgen.kernel import Matrix
from symgen.mechanics.coordinates import independent_forces
from symgen.mechanics.dynamics import by_parameters, inverse_dynamics
from symgen.mechanics.kinematics import joint_poses


def coriolis_matrix(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """C(q, dq) of Christoffel symbols: dM/dt − 2 C is skew-symmetric.

    q (n,) [rad, m], dq (n,) [rad/s, m/s], pi (10 L,) → (n, n) [N·m·s/rad, N·s/m].
    """
    return ca.densify(ca.jacobian(_centrifugal(chain, q, dq, pi), dq) / 2)


def slotine_li_regressor(
    chain: Chain, q: Matrix, dq: Matrix, dq_r: Matrix, ddq_r: Matrix
) -> Matrix:
    """Y with Y π = M(q) ddq_r + C(q, dq) dq_r + g(q), C of Christoffel symbols.

    q (n,) [rad, m], dq (n,) [rad/s, m/s], dq_r (n,) [rad/s, m/s], ddq_r (n,) [rad/s², m/s²] → (n,
    10 L).
    """
    still = ca.SX(len(chain.coordinates), 1)

    def torque(pi: Matrix) -> Matrix:
        pushed = inverse_dynamics(chain, q, still, ddq_r, pi)
        return pushed + ca.jtimes(_centrifugal(chain, q, dq, pi), dq, dq_r) / 2

    return by_parameters(chain, torque)


def frame_jacobians(chain: Chain, q: Matrix) -> Matrix:
    """Jacobians of the frames of all links and of the tip, v = J dq.

    v is the linear velocity of the frame's origin, then the angular velocity, both in axes of the
    base, with a free base in axes of the world.

    q (n,) [rad, m].
    """
    poses = joint_poses(chain, q)
    rotations: list[Matrix] = []
    origins: list[Matrix] = []
    for i, joint in enumerate(chain.joints):
        pose = poses[i]
        if joint.parent >= 0:
            before = rotations[joint.parent]
            origins.append(origins[joint.parent] + ca.mtimes(before, pose.translation))
            rotations.append(ca.mtimes(before, pose.rotation))
        else:
            origins.append(pose.translation)
            rotations.append(pose.rotation)
    axes = [ca.mtimes(r, ca.DM(j.axis)) for r, j in zip(rotations, chain.joints, strict=True)]
    frames = list(enumerate(origins))
    if chain.tip.joint >= 0:
        offset = ca.mtimes(rotations[chain.tip.joint], ca.DM(chain.tip.translation))
        frames.append((chain.tip.joint, origins[chain.tip.joint] + offset))
    else:  # a tip that no joint moves
        frames.append((-1, ca.SX(3, 1)))
    blocks = []
    first = BASE_FREEDOM - 1 if chain.floating else 0  # joint k has column first + k
    for last, origin in frames:
        jacobian, k = ca.SX(6, first + len(chain.joints)), last
        while k >= 0:
            kind, lever = chain.joints[k].kind, origin - origins[k]
            if kind == FLOATING:  # v = R v_b + (R ω_b) × lever, ω = R ω_b
                jacobian[:3, :3] = jacobian[3:, 3:BASE_FREEDOM] = rotations[k]
                jacobian[:3, 3:BASE_FREEDOM] = -ca.mtimes(ca.skew(lever), rotations[k])
            elif kind == "prismatic":
                jacobian[:3, first + k] = axes[k]
            else:
                jacobian[:3, first + k] = ca.cross(axes[k], lever)
                jacobian[3:, first + k] = axes[k]
            k = chain.joints[k].parent
        blocks.append(independent_forces(chain, q, jacobian.T).T)  # J A of coupled joints
    return ca.vertcat(*blocks)


def _centrifugal(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """c = C(q, dq) dq, Coriolis and centrifugal forces."""
    still = ca.SX(len(chain.coordinates), 1)
    return inverse_dynamics(chain, q, dq, still, pi, gravity=False)
