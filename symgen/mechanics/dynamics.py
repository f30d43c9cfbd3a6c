"""Rigid-body dynamics of a `Chain`, written once: recursive Newton–Euler in link frames.

τ = Σ_k J_kᵀ (M_k ẍ_k − adᵀ(v_k) M_k v_k) (Eq. 4.3) is evaluated by two sweeps, outwards for
velocities and accelerations, inwards for wrenches. It is linear in π by construction, so the
regressor and every Jacobian follow by differentiation of this one function.
Gravity enters as an acceleration −g of the base. Throughout the mechanics of a chain, q (n,) is in
rad or m, dq and ddq are its derivatives (of a free base: see `kinematics`), τ (n,) is in N·m or N,
and π and λ (10 L,) are those of all L links.

Momentum and energies give the equations of motion without accelerations,

    τ = dp/dt − r,   p = M(q) dq,   r = ∂(T − U)/∂q        dq·τ = d(T + U)/dt

all linear in π. A linear, time-invariant filter F gives F τ = d(F p)/dt − F r: only what F has
smoothed is differentiated. Terms of controllers: with c(q, dq) = C dq, quadratic in dq, and the
Christoffel symbols Γ symmetric in their last two indices,

    C = ½ ∂c/∂dq,   C(q, dq) x = ½ (∂c/∂dq) x,   dM/dt = C + Cᵀ

M(q) is by the composite-rigid-body method: column i is the wrench for a unit acceleration of joint
i with all bodies beyond it as one rigid body, projected on the joints towards the base.

Source: Slotine & Li, IJRR 6(3), 1987 (momentum, adaptive control); Gautier & Khalil 1988 (energy);
Siciliano et al., Robotics, 2009, eqs. 7.44–7.47; Walker & Orin, J. Dyn. Sys. Meas. Control 104(3),
1982, and Featherstone, Rigid Body Dynamics Algorithms, 2008, Table 6.2 (M).
"""

from collections.abc import Callable

import casadi as ca
import numpy as np

from symgen.chain import Chain
from symgen.chain.model import BASE_FREEDOM, FLOATING
from symgen.kernel import Array, Matrix
from symgen.mechanics import kinematics
from symgen.mechanics.closure import supplied
from symgen.mechanics.inertia import (
    N_PARAMETERS,
    bodies_of,
    in_parent_frame,
    pi_from_lam,
    sum_of_bodies,
)
from symgen.mechanics.spatial import joint_pose


def inverse_dynamics(
    chain: Chain, q: Matrix, dq: Matrix, ddq: Matrix, pi: Matrix, gravity: bool = True
) -> Matrix:
    """τ(q, dq, ddq, π) (Eqs. 2.34, 4.3, 4.4)."""
    n = len(chain.joints)
    ddq = kinematics.per_joint(chain, kinematics.all_accelerations(chain, q, dq, ddq))
    dq = kinematics.per_joint(chain, kinematics.all_rates(chain, q, dq))
    poses = kinematics.joint_poses(chain, q)
    omega: list[Matrix] = []
    alpha: list[Matrix] = []
    accel: list[Matrix] = []
    spread: list[Matrix] = []  # [α×] + [ω×]²: acceleration of a point = a + spread · offset
    zero = ca.SX(3, 1)
    base_accel = ca.SX(-ca.DM(chain.gravity)) if gravity else zero
    # Outward sweep: ω, α and the acceleration a of each frame's origin, in the frame itself.
    for i, joint in enumerate(chain.joints):
        pose = poses[i]
        root = joint.parent < 0
        w, al = (zero, zero) if root else (omega[joint.parent], alpha[joint.parent])
        a = base_accel if root else accel[joint.parent]
        back, p = pose.rotation.T, pose.translation
        w_here = ca.mtimes(back, w)
        a_here = ca.mtimes(back, a if root else a + ca.mtimes(spread[joint.parent], p))
        al_here = ca.mtimes(back, al)
        if joint.kind == "prismatic":  # Coriolis term 2 ω × (axis dq)
            a_here = a_here + pose.axis * ddq[i] + 2 * ca.cross(w_here, pose.axis * dq[i])
        elif joint.kind == FLOATING:  # dq and ddq are those of the base, in its axes
            w_here, al_here = dq[i][3:], ddq[i][3:]
            a_here = a_here + ddq[i][:3] + ca.cross(w_here, dq[i][:3])
        else:
            spin = pose.axis * dq[i]
            al_here = al_here + pose.axis * ddq[i] + ca.cross(w_here, spin)
            w_here = w_here + spin
        omega.append(w_here)
        alpha.append(al_here)
        accel.append(a_here)
        spread.append(_spread(w_here, al_here))

    # Inward sweep: f = m a + ([α×] + [ω×]²) m c and its moment, plus those of the children.
    bodies = bodies_of(pi)
    force, moment = [zero] * n, [zero] * n
    tau: list[Matrix] = [0] * n
    for i in reversed(range(n)):
        joint, pose = chain.joints[i], poses[i]
        mass, h, inertia = bodies[i]
        w, al, a = omega[i], alpha[i], accel[i]
        f = force[i] + mass * a + ca.mtimes(spread[i], h)
        m = moment[i] + _euler_moment(inertia, w, al, spread[i]) + ca.cross(h, a)
        if joint.kind == FLOATING:
            tau[i] = ca.vertcat(f, m)
        else:
            tau[i] = ca.dot(pose.axis, f if joint.kind == "prismatic" else m)
        if joint.parent >= 0:
            f_parent = ca.mtimes(pose.rotation, f)
            force[joint.parent] = force[joint.parent] + f_parent
            moment[joint.parent] = (
                moment[joint.parent]
                + ca.mtimes(pose.rotation, m)
                + ca.cross(pose.translation, f_parent)
            )
    return kinematics.independent_forces(chain, q, ca.vertcat(*tau))


def _spread(w: Matrix, al: Matrix) -> Matrix:
    """[α×] + [ω×]²: the acceleration of a point at offset r is a + spread · r."""
    x, y, z = w[0], w[1], w[2]
    diagonal = ca.vertcat(-(y * y + z * z), -(x * x + z * z), -(x * x + y * y))
    off = ca.vertcat(x * y, x * z, y * z)
    rows = ca.SX(3, 3)
    rows[0, 0], rows[1, 1], rows[2, 2] = diagonal[0], diagonal[1], diagonal[2]
    rows[0, 1], rows[1, 0] = off[0] - al[2], off[0] + al[2]
    rows[0, 2], rows[2, 0] = off[1] + al[1], off[1] - al[1]
    rows[1, 2], rows[2, 1] = off[2] - al[0], off[2] + al[0]
    return rows


def _euler_moment(inertia: Matrix, w: Matrix, al: Matrix, u: Matrix) -> Matrix:
    """I α + ω × I ω from the entries of u = `_spread`, which the forces need as well.

    Component x is XX α_x + (ZZ − YY) ω_y ω_z − XY u_zx + XZ u_yx + YZ (ω_y² − ω_z²); y and z follow
    cyclically. This takes a third fewer operations than the two products.
    """
    parts = []
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        parts.append(
            inertia[k, k] * al[k]
            + (inertia[j, j] - inertia[i, i]) * (w[i] * w[j])
            - inertia[k, i] * u[j, k]
            + inertia[k, j] * u[i, k]
            + inertia[i, j] * (w[i] * w[i] - w[j] * w[j])
        )
    return ca.vertcat(*parts)


def regressor(
    chain: Chain, q: Matrix, dq: Matrix, ddq: Matrix, columns: tuple[int, ...] | None = None
) -> Matrix:
    """Y = ∂τ/∂π, (n, 10 L) (Eq. 3.1), by differentiation, as cheap as written by hand."""
    return by_parameters(chain, lambda pi: inverse_dynamics(chain, q, dq, ddq, pi), columns)


def by_parameters(
    chain: Chain, linear: Callable[[Matrix], Matrix], columns: tuple[int, ...] | None = None
) -> Matrix:
    """∂f/∂π (m, 10 L) of a linear f(π); entries beside `columns` are structural zeros."""
    pi = ca.SX.sym("pi", N_PARAMETERS * len(chain.joints))
    if columns is None:
        return ca.jacobian(linear(pi), pi)
    chosen = ca.vertcat(*(pi[c] for c in columns))
    wanted = set(columns)
    sparse = ca.vertcat(*(pi[c] if c in wanted else 0 for c in range(pi.numel())))
    return ca.jacobian(linear(sparse), chosen)


def sampled_regressor(chain: Chain) -> Callable[[Array, Array, Array], Array]:
    """Return a numeric function of the regressor at many states."""
    n = chain.freedom
    q, dq, ddq = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
    rows = supplied(chain, ca.densify(ca.vec(regressor(chain, q, dq, ddq).T)), q)
    function = ca.Function("Y", [q, dq, ddq], [rows], {"cse": True})

    def sample(q: Array, dq: Array, ddq: Array) -> Array:
        stacked = np.asarray(function.map(len(q))(q.T, dq.T, ddq.T))
        return stacked.T.reshape(len(q), n, N_PARAMETERS * len(chain.joints))

    return sample


def pi_from_lam_all(lam: Matrix) -> Matrix:
    """π of all links from λ of all links."""
    blocks = range(0, lam.numel(), N_PARAMETERS)
    return ca.vertcat(*(pi_from_lam(lam[k : k + N_PARAMETERS]) for k in blocks))


def torque_jacobian(chain: Chain, q: Matrix, dq: Matrix, ddq: Matrix, lam: Matrix) -> Matrix:
    """∂τ/∂λ = Y blockdiag(∂π_k/∂λ_k), (n, 10 L) (Eqs. 4.34–4.36)."""
    one = ca.SX.sym("lam", N_PARAMETERS)
    block = ca.Function("block", [one], [ca.jacobian(pi_from_lam(one), one)])
    y = regressor(chain, q, dq, ddq)
    columns = [slice(k, k + N_PARAMETERS) for k in range(0, lam.numel(), N_PARAMETERS)]
    return ca.horzcat(*(ca.mtimes(y[:, c], block(lam[c])) for c in columns))


def bias_forces(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """h(q, dq) = τ(q, dq, 0): Coriolis, centrifugal and gravity terms."""
    return inverse_dynamics(chain, q, dq, ca.SX(chain.freedom, 1), pi)


def momentum(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """p = ∂T/∂dq = M(q) dq: the torque that gives a robot at rest the acceleration dq."""
    return inverse_dynamics(chain, q, ca.SX(len(chain.coordinates), 1), dq, pi, gravity=False)


def energies(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> tuple[Matrix, Matrix]:
    """T = Σ_k m v·v/2 + h·(v × ω) + ω·I ω/2 and U = −Σ_k g·(m p + R h), both linear in π.

    v and ω are the velocities of the link frame, p and R its pose in the base frame, h = m c. U is
    zero where every frame is at the base. Lagrange's equations of T − U are those of
    `inverse_dynamics`.
    """
    dq, q = kinematics.all_rates(chain, q, dq), kinematics.all_positions(chain, q)
    omega: list[Matrix] = []
    speed: list[Matrix] = []
    down: list[Matrix] = []  # gravity in the link's frame
    drop: list[Matrix] = []  # g · p
    zero, gravity = ca.SX(3, 1), ca.SX(ca.DM(chain.gravity))
    kinetic, potential = ca.SX(0), ca.SX(0)
    bodies = bodies_of(pi)
    for i, joint in enumerate(chain.joints):
        pose, root = joint_pose(joint, q[i]), joint.parent < 0
        w, v = (zero, zero) if root else (omega[joint.parent], speed[joint.parent])
        g, fall = (gravity, 0) if root else (down[joint.parent], drop[joint.parent])
        back, p = pose.rotation.T, pose.translation
        w_here, v_here = ca.mtimes(back, w), ca.mtimes(back, v + ca.cross(w, p))
        if joint.kind == "prismatic":
            v_here = v_here + pose.axis * dq[i]
        else:
            w_here = w_here + pose.axis * dq[i]
        omega.append(w_here)
        speed.append(v_here)
        down.append(ca.mtimes(back, g))
        drop.append(fall + ca.dot(g, p))
        mass, h, inertia = bodies[i]
        spin = ca.dot(w_here, ca.mtimes(inertia, w_here)) / 2
        lever = ca.dot(h, ca.cross(v_here, w_here))
        kinetic = kinetic + mass * ca.dot(v_here, v_here) / 2 + lever + spin
        potential = potential - mass * drop[i] - ca.dot(down[i], h)
    return kinetic, potential


def lagrange_force(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """r = ∂(T − U)/∂q, so that τ = dp/dt − r."""
    kinetic, potential = energies(chain, q, dq, pi)
    return ca.gradient(kinetic - potential, q)


def coriolis_matrix(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """C(q, dq) of Christoffel symbols, (n, n): dM/dt − 2 C is skew-symmetric."""
    return ca.densify(ca.jacobian(_centrifugal(chain, q, dq, pi), dq) / 2)


def slotine_li_regressor(
    chain: Chain, q: Matrix, dq: Matrix, dq_r: Matrix, ddq_r: Matrix
) -> Matrix:
    """Y with Y π = M(q) ddq_r + C(q, dq) dq_r + g(q), C of Christoffel symbols."""
    still = ca.SX(len(chain.coordinates), 1)

    def torque(pi: Matrix) -> Matrix:
        pushed = inverse_dynamics(chain, q, still, ddq_r, pi)
        return pushed + ca.jtimes(_centrifugal(chain, q, dq, pi), dq, dq_r) / 2

    return by_parameters(chain, torque)


def _centrifugal(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """c = C(q, dq) dq, Coriolis and centrifugal forces."""
    return inverse_dynamics(chain, q, dq, ca.SX(len(chain.coordinates), 1), pi, gravity=False)


def mass_matrix(chain: Chain, q: Matrix, pi: Matrix) -> Matrix:
    """M(q) = ∂τ/∂ddq, M = Mᵀ to the bit (Eq. 2.34), (n, n) [kg·m², kg·m, kg]."""
    n = len(chain.joints)
    poses = kinematics.joint_poses(chain, q)
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
    return ca.densify(kinematics.independent_mass(chain, q, m))


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
