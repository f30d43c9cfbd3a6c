"""M(q) and forward dynamics of a `Chain`.

Composite-rigid-body method in link frames: column i of M is the wrench for a unit acceleration of
joint i with all bodies beyond it as one rigid body, projected on the joints towards the base.
Source: Walker & Orin, J. Dyn. Sys. Meas. Control 104(3), 1982; Featherstone, Rigid Body Dynamics
Algorithms, 2008, Table 6.2.
"""

import casadi as ca

from symgen.chain import Chain
from symgen.chain.model import BASE_FREEDOM, FLOATING
from symgen.kernel import Matrix
from symgen.mechanics.dynamics import bias_forces
from symgen.mechanics.inertia import bodies_of, in_parent_frame, sum_of_bodies
from symgen.mechanics.kinematics import independent_mass, joint_poses


def mass_matrix(chain: Chain, q: Matrix, pi: Matrix) -> Matrix:
    """M(q) = ∂τ/∂ddq, M = Mᵀ to the bit (Eq. 2.34), (n, n) [kg·m², kg·m, kg]."""
    n = len(chain.joints)
    poses = joint_poses(chain, q)
    beyond = bodies_of(pi)
    size = n - 1 + BASE_FREEDOM if chain.floating else n
    first = size - n  # joint i has row and column first + i
    m = ca.SX(size, size)
    for i in reversed(range(n)):  # from the tip inwards: `beyond[i]` is complete when i is reached
        joint, pose = chain.joints[i], poses[i]
        # Wrench on the composite body for ddq_i = 1, about the origin of frame i.
        mass, moment, inertia = beyond[i]
        if joint.kind == FLOATING:  # of all bodies together: [m 1, −[h×]; [h×], I]
            lever = ca.skew(moment)
            m[:3, :3], m[:3, 3:BASE_FREEDOM] = mass * ca.DM.eye(3), -lever
            m[3:BASE_FREEDOM, :3], m[3:BASE_FREEDOM, 3:BASE_FREEDOM] = lever, inertia
            continue
        axis = ca.SX(pose.axis)
        if joint.kind == "prismatic":
            force, couple = mass * axis, ca.cross(moment, axis)
        else:
            force, couple = ca.cross(axis, moment), ca.mtimes(inertia, axis)
        k = i  # carry the wrench towards the base and project it on each joint's axis
        while k >= 0:
            at, kind = poses[k], chain.joints[k].kind
            if kind == FLOATING:
                m[first + i, :BASE_FREEDOM] = ca.vertcat(force, couple).T
                m[:BASE_FREEDOM, first + i] = ca.vertcat(force, couple)
                break
            entry = ca.dot(at.axis, force if kind == "prismatic" else couple)
            m[first + i, first + k] = m[first + k, first + i] = entry
            force, couple = ca.mtimes(at.rotation, force), ca.mtimes(at.rotation, couple)
            couple += ca.cross(at.translation, force)
            k = chain.joints[k].parent
        if joint.parent >= 0:
            more = in_parent_frame(pose.rotation, pose.translation, beyond[i])
            beyond[joint.parent] = sum_of_bodies(beyond[joint.parent], more)
    return ca.densify(independent_mass(chain, q, m))


def forward_dynamics(
    chain: Chain, q: Matrix, dq: Matrix, tau: Matrix, pi: Matrix, rotor: Matrix
) -> Matrix:
    """ddq = (M + diag(J))⁻¹ (τ − h) by an unrolled LDLᵀ; no square roots, no pivoting (M ≻ 0)."""
    n = chain.freedom
    m = mass_matrix(chain, q, pi) + ca.diag(rotor)
    x = tau - bias_forces(chain, q, dq, pi)
    if chain.floating or chain.is_large:
        # From the tips to the base: branches stay apart, so that L has the zeros of M
        # (Featherstone, Rigid Body Dynamics Algorithms, 2008, Sec. 6.5).
        back = list(reversed(range(n)))
        return _solved(m[back, back], x[back])[back]
    return _solved(m, x)


def _solved(m: Matrix, x: Matrix) -> Matrix:
    """M⁻¹ x by an unrolled LDLᵀ."""
    n = x.numel()
    rows: list[list[Matrix]] = [[0] * n for _ in range(n)]
    d: list[Matrix] = [0] * n
    for j in range(n):  # M = L D Lᵀ, L with a unit diagonal
        v = [rows[j][k] * d[k] for k in range(j)]
        d[j] = m[j, j] - sum(rows[j][k] * v[k] for k in range(j))
        for i in range(j + 1, n):
            rows[i][j] = (m[i, j] - sum(rows[i][k] * v[k] for k in range(j))) / d[j]
    y: list[Matrix] = [0] * n
    for i in range(n):  # L y = x
        y[i] = x[i] - sum(rows[i][k] * y[k] for k in range(i))
    z: list[Matrix] = [0] * n
    for i in reversed(range(n)):  # Lᵀ z = D⁻¹ y
        z[i] = y[i] / d[i] - sum(rows[k][i] * z[k] for k in range(i + 1, n))
    return ca.vertcat(*z)


def mobility_bound(chain: Chain, pi: Matrix) -> Matrix:
    """S(π) with M(q)⁻¹ ⪯ S for every q, (L, L): proof that M(q) is positive definite.

    Joint i has the rate dq_i = aᵀ V_i − aᵀ X_i V_p of the velocities V of its body and of the body
    before it, in short dq = B V. Kinetic energy is Vᵀ I V / 2, and its minimum over all V with
    B V = dq, even those of no motion of the joints, is dqᵀ (B I⁻¹ Bᵀ)⁻¹ dq / 2 ≤ dqᵀ M dq / 2.
    a is invariant under its own joint, aᵀ X_i(q_i) = aᵀ X_i(0), so S = B I⁻¹ Bᵀ is constant.
    """
    n = len(chain.joints)
    inverses = [_inverse_inertia(*body) for body in bodies_of(pi)]
    rows: list[dict[int, Matrix]] = []  # body → its block of a row of B
    for i, joint in enumerate(chain.joints):
        axis, zero = ca.DM(joint.axis), ca.DM(3, 1)
        slides = joint.kind == "prismatic"
        row = {i: ca.vertcat(axis, zero) if slides else ca.vertcat(zero, axis)}
        if joint.parent >= 0:  # v_i = Rᵀ (v_p + ω_p × p), ω_i = Rᵀ ω_p
            turned, p = ca.mtimes(ca.DM(joint.rotation), axis), ca.DM(joint.translation)
            back = ca.vertcat(turned, ca.cross(p, turned)) if slides else ca.vertcat(zero, turned)
            row[joint.parent] = -back
        rows.append(row)
    s = ca.SX(n, n)
    for i in range(n):
        for k in range(i + 1):
            shared = rows[i].keys() & rows[k].keys()
            s[i, k] = s[k, i] = sum(
                (ca.dot(rows[i][b], ca.mtimes(inverses[b], rows[k][b])) for b in sorted(shared)),
                ca.SX(1, 1),
            )
    return ca.densify(s)


def _inverse_inertia(mass: Matrix, moment: Matrix, inertia: Matrix) -> Matrix:
    """Inverse of the (6, 6) inertia of a body about its frame's origin, linear part first.

    With c = h / m and Σ the inertia about the centre of mass, it is
    [1/m + [c×] Σ⁻¹ [c×]ᵀ, [c×] Σ⁻¹; Σ⁻¹ [c×]ᵀ, Σ⁻¹].
    """
    arm = ca.skew(moment / mass)
    turning = ca.inv(inertia + mass * ca.mtimes(arm, arm))  # Σ = I − m [c×]ᵀ [c×], closed form
    across = ca.mtimes(arm, turning)
    moving = ca.SX.eye(3) / mass + ca.mtimes(across, arm.T)
    return ca.blockcat([[moving, across], [across.T, turning]])
