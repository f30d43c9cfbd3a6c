"""Bounds of torques, tip and links, and of their derivatives in time, on an interval of a motion.

On the interval let |dᵏq_j/dtᵏ| ≤ k! s_jk. Then every vector x of the recursions in `dynamics`
has bounds |dᵏx/dtᵏ| ≤ k! x_k, which follow from the same recursions with norms in the place of
vectors: a sum adds bounds, a product multiplies them as power series do, (x y)_k = Σ x_i y_k−i.
A rotation E with E' = dq [z×] E has E_0 = 1 and (k + 1) E_k+1 = Σ (i + 1) s_i+1 E_k−i. Vectors are
taken in link frames, in which rotations of the joints before a link do not count.

All terms are positive, so that rounding is relative; `_OUTWARD` exceeds it.
Source: Leibniz's rule; majorant series of Cauchy and Kovalevskaya.
"""

import math

import casadi as ca
import numpy as np

from symgen.chain import Chain, Joint
from symgen.chain.model import path_to
from symgen.kernel import Matrix
from symgen.mechanics.inertia import bodies_of

Series = list[Matrix]  # bounds x_k of |dᵏx/dtᵏ| / k!, lowest order first

_OUTWARD = 1 + 1e-12  # some hundred operations on the longest path, each rounded by 1.1e-16


def torque_bounds(chain: Chain, motion: Matrix, pi: Matrix, orders: int = 4) -> Matrix:
    """Bounds of |dᵏτ_j/dtᵏ|: motion (orders + 2, n) → (orders, n) [N·m, N]."""
    joints = chain.joints
    shifts = _of_joints(chain, motion)
    turns: list[Series] = []  # rotation of the joint
    arms: list[Series] = []  # offset of the frame in its parent's frame
    omega: list[Series] = []
    spread: list[Series] = []  # [α×] + [ω×]², as in `dynamics`
    accel: list[Series] = []
    still, gravity = _constant(0.0, orders), _constant(_norm(ca.DM(chain.gravity)), orders)
    for joint, shift in zip(joints, shifts, strict=True):
        root, slides = joint.parent < 0, joint.kind == "prismatic"
        turn = _turn(joint, shift, orders + 1)
        arm = _arm(joint, shift, orders)
        w = _constant(0.0, orders + 1) if root else omega[joint.parent]
        a = gravity if root else _sum(accel[joint.parent], _times(spread[joint.parent], arm))
        w, a = _times(turn, w), _times(turn, a)
        rate = _rate(shift)
        if slides:  # a + axis ddq + 2 ω × (axis dq)
            a = _sum(a, _rate(rate), _scaled(2.0, _times(w, rate)))
        else:
            w = _sum(w, rate)
        turns.append(turn)
        arms.append(arm)
        omega.append(w)
        spread.append(_sum(_rate(w), _times(w, w)))
        accel.append(a)
    force, moment = [still] * len(joints), [still] * len(joints)
    tau: list[Matrix] = [None] * len(joints)
    bodies = bodies_of(pi)
    for i in reversed(range(len(joints))):
        joint = joints[i]
        mass, h, inertia = bodies[i]
        mass, lever, size = ca.fabs(mass), _norm(h), _norm(inertia)
        f = _sum(force[i], _scaled(mass, accel[i]), _scaled(lever, spread[i]))
        m = _sum(moment[i], _scaled(size, spread[i]), _scaled(lever, accel[i]))
        tau[i] = f if joint.kind == "prismatic" else m
        if joint.parent >= 0:
            turned = _times(turns[i], f)
            force[joint.parent] = _sum(force[joint.parent], turned)
            more = _sum(_times(turns[i], m), _times(arms[i], turned))
            moment[joint.parent] = _sum(moment[joint.parent], more)
    every = ca.horzcat(*(_derivatives(series[:orders]) for series in tau))
    if chain.coupling is not None:
        every = ca.mtimes(every, _sizes(chain))
    return _OUTWARD * every


def tip_bounds(chain: Chain, motion: Matrix) -> Matrix:
    """Bounds of the distance of the tip from the base and of its derivatives, (orders,) [m]."""
    orders = motion.shape[0]
    shifts = _of_joints(chain, motion)
    turned, place = _constant(1.0, orders), _constant(0.0, orders)
    for i in path_to(chain.joints, chain.tip.joint):
        joint = chain.joints[i]
        place = _sum(place, _times(turned, _arm(joint, shifts[i], orders)))
        turned = _times(turned, _turn(joint, shifts[i], orders))
    place = _sum(place, _scaled(_norm(ca.DM(chain.tip.translation)), turned))
    return _OUTWARD * _derivatives(place)


def speed_bounds(chain: Chain, motion: Matrix) -> tuple[Matrix, Matrix]:
    """Speeds (L, L) [m/s] that joint j gives to link i, and turning speeds (L,) of the joints."""
    shifts = _of_joints(chain, motion)
    count = len(chain.joints)
    speed, turn = ca.SX(count, count), ca.SX(count, 1)
    for j, joint in enumerate(chain.joints):
        if joint.kind != "prismatic":
            turn[j] = shifts[j][1]
    for i in range(count):
        j, reach = i, 0.0
        while j >= 0:  # towards the base, with the length of the way from joint j to link i
            joint = chain.joints[j]
            speed[i, j] = shifts[j][1] if joint.kind == "prismatic" else reach * shifts[j][1]
            reach, j = reach + _arm(joint, shifts[j], 1)[0], joint.parent
    return _OUTWARD * speed, _OUTWARD * turn


def _of_joints(chain: Chain, motion: Matrix) -> list[Series]:
    """Bounds of all joints, with |A| and |b| of q_all = A q + b."""
    if chain.coupling is not None:
        motion = ca.mtimes(motion, _sizes(chain).T)
        motion[0, :] += ca.DM(np.abs(chain.coupling.offset)).T
    orders = range(motion.shape[0])
    return [[motion[k, j] / math.factorial(k) for k in orders] for j in range(len(chain.joints))]


def _sizes(chain: Chain) -> Matrix:
    return ca.DM(np.abs(np.array(chain.coupling.matrix)))  # type: ignore[union-attr]


def _turn(joint: Joint, shift: Series, orders: int) -> Series:
    series = _constant(1.0, orders)
    if joint.kind == "prismatic":
        return series
    rate = _rate(shift)
    for k in range(orders - 1):
        series[k + 1] = sum(rate[i] * series[k - i] for i in range(k + 1)) / (k + 1)
    return series


def _arm(joint: Joint, shift: Series, orders: int) -> Series:
    arm = _constant(_norm(ca.DM(joint.translation)), orders)
    return _sum(arm, shift) if joint.kind == "prismatic" else arm


def _norm(x: Matrix) -> Matrix:
    return ca.sqrt(ca.sumsqr(x))  # Frobenius, not below the spectral norm


def _constant(value: Matrix, orders: int) -> Series:
    return [value, *[0.0] * (orders - 1)]


def _sum(*terms: Series) -> Series:
    """Sum to the lowest order that all terms have."""
    return [sum(each) for each in zip(*terms, strict=False)]


def _scaled(factor: Matrix, series: Series) -> Series:
    return [factor * each for each in series]


def _times(x: Series, y: Series) -> Series:
    """Product to the lowest order that both have."""
    return [sum(x[i] * y[k - i] for i in range(k + 1)) for k in range(min(len(x), len(y)))]


def _rate(series: Series) -> Series:
    """Derivative in time, one order shorter."""
    return [(k + 1) * each for k, each in enumerate(series[1:])]


def _derivatives(series: Series) -> Matrix:
    return ca.vertcat(*(math.factorial(k) * ca.SX(each) for k, each in enumerate(series)))
