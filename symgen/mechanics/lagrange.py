"""Momentum and energies of a `Chain`, and equations of motion without accelerations.

    τ = dp/dt − r,   p = M(q) dq,   r = ∂(T − U)/∂q        dq·τ = d(T + U)/dt

All are linear in π. A linear, time-invariant filter F gives F τ = d(F p)/dt − F r: only what F has
smoothed is differentiated. Source: Slotine & Li 1987 (momentum), Gautier & Khalil 1988 (energy).
"""

import casadi as ca

from symgen.chain import Chain
from symgen.kernel import Matrix
from symgen.mechanics.coordinates import all_positions, all_rates
from symgen.mechanics.dynamics import inverse_dynamics
from symgen.mechanics.inertia import bodies_of
from symgen.mechanics.pose import joint_pose


def momentum(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> Matrix:
    """p = ∂T/∂dq = M(q) dq: the torque that gives a robot at rest the acceleration dq.

    q (n,) [rad, m], dq (n,) [rad/s, m/s], pi (10 L,) → (n,) [kg·m²/s, kg·m/s].
    """
    return inverse_dynamics(chain, q, ca.SX(len(chain.coordinates), 1), dq, pi, gravity=False)


def energies(chain: Chain, q: Matrix, dq: Matrix, pi: Matrix) -> tuple[Matrix, Matrix]:
    """T = Σ_k m v·v/2 + h·(v × ω) + ω·I ω/2 and U = −Σ_k g·(m p + R h), both linear in π.

    v and ω are the velocities of the link frame, p and R its pose in the base frame, h = m c. U is
    zero where every frame is at the base. Lagrange's equations of T − U are those of
    `inverse_dynamics`.

    q (n,) [rad, m], dq (n,) [rad/s, m/s], pi (10 L,).
    """
    dq, q = all_rates(chain, q, dq), all_positions(chain, q)
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
    """r = ∂(T − U)/∂q, so that τ = dp/dt − r.

    q (n,) [rad, m], dq (n,) [rad/s, m/s], pi (10 L,) → (n,) [N·m, N].
    """
    kinetic, potential = energies(chain, q, dq, pi)
    return ca.gradient(kinetic - potential, q)
