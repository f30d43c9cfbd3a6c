"""Equivalent inertial parameters with as many structural zeros as possible, on symbols.

Entries of π that do not act on the torque separately are moved towards the base: the part of a body
that its joint does not move relative to the link before acts as if it were fixed to that link. The
kernels of torque and mass take the result: a seventh to a fifth fewer operations, and the same τ.
Source: Gautier & Khalil, IEEE T-RA 6(3), 1990 (Table 3.2), for trees and any placement of joints.
"""

import casadi as ca

from symgen.chain import Chain, Joint
from symgen.chain.model import FLOATING
from symgen.kernel import Matrix
from symgen.mechanics.inertia import MassMoments, bodies_of, joined, pi_of_body, seen_from


def regrouped(chain: Chain, pi: Matrix) -> Matrix:
    """Return a π' with Y π' = Y π whose entries are mostly structural zeros.

    pi (10 n,) → (10 n,).
    """
    bodies = bodies_of(pi)
    # From the tip inwards, so that a body holds what its children gave before it is split.
    for i, joint in reversed(list(enumerate(chain.joints))):
        bodies[i], moved = _split(joint, bodies[i])
        # Moved at q = 0: the moved part is invariant under the joint's motion, so any q would do.
        if joint.parent >= 0:  # what is moved to the base acts on no joint and is dropped
            rotation, translation = ca.SX(ca.DM(joint.rotation)), ca.DM(joint.translation)
            more = seen_from(ca.sparsify(rotation), translation, moved)
            bodies[joint.parent] = joined(bodies[joint.parent], more)
    return ca.vertcat(*(pi_of_body(*body) for body in bodies))


def _split(joint: Joint, body: MassMoments) -> tuple[MassMoments, MassMoments]:
    """Split a body into the part that its joint moves and the part that acts as if it were fixed.

    A prismatic joint does not rotate: all of I is moved. About an axis z the mass, mZ, and YY as
    the body diag(YY, YY, 0) are moved, since every rotation about z maps that body to itself; x and
    y follow cyclically. For an axis that is not an axis of the frame the body is left as it is: its
    parts would fill the matrices that the others empty.
    """
    mass, moment, inertia = body
    nothing, point, ball = ca.SX(1, 1), ca.SX(3, 1), ca.SX(3, 3)
    if joint.kind == FLOATING:  # moves the whole body
        return body, (nothing, point, ball)
    if joint.kind == "prismatic":
        return (mass, moment, ball), (nothing, point, inertia)
    if sorted(abs(entry) for entry in joint.axis) != [0.0, 0.0, 1.0]:
        return body, (nothing, point, ball)
    # Axis ±z of the frame: mass and m z go, and YY as diag(YY, YY, 0), so that XX keeps XX − YY.
    z = [abs(entry) for entry in joint.axis].index(1.0)
    x, y = (z + 1) % 3, (z + 2) % 3
    along, across = ca.SX(3, 1), ca.SX(3, 1)
    along[z], across[x], across[y] = moment[z], moment[x], moment[y]
    round_, rest = ca.SX(3, 3), ca.SX(inertia)
    round_[x, x] = round_[y, y] = inertia[y, y]
    rest[x, x], rest[y, y] = inertia[x, x] - inertia[y, y], 0
    return (nothing, across, ca.sparsify(rest)), (mass, along, round_)
