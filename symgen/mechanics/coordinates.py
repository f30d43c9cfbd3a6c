"""Independent coordinates of a `Chain`: q_all = A q + b, τ = Aᵀ τ_all, M = Aᵀ M_all A.

The recursions of the other modules run over all joints; these maps lead in and out of them. Where
every joint is independent they return their argument itself, so that no operation is added.

With a free base the first six entries are its own. q: position of the base in the world [m], and
the rotation vector ω of its axes, R = exp(ω) [rad]. dq: its velocity [m/s] and angular velocity
[rad/s], both in the axes of the base. ddq: the derivatives of these six numbers, so that the
acceleration of the base's origin is ddq_v + ω × v. τ: force [N] and moment [N·m] on the base, in
its axes, about its origin. dq is not the derivative of q there.
"""

import casadi as ca

from symgen.chain import Chain
from symgen.chain.joint import BASE_FREEDOM
from symgen.kernel import Matrix


def per_joint(chain: Chain, values: Matrix) -> list[Matrix]:
    """Entries of each joint.

    Args:
        chain: N joints; a free base is one of six entries.
        values: (N,) or, with a free base, (N + 5,) of all joints.

    Returns:
        One (1,) per joint, (6,) of a free base.
    """
    if not chain.floating:
        return [values[i] for i in range(len(chain.joints))]
    rest = range(BASE_FREEDOM, BASE_FREEDOM + len(chain.joints) - 1)
    return [values[:BASE_FREEDOM], *(values[i] for i in rest)]


def all_positions(chain: Chain, q: Matrix) -> Matrix:
    """q_all = A q + b.

    Args:
        chain: N joints, n of them independent.
        q: (n,) positions of the independent joints [rad, m].

    Returns:
        (N,) positions of all joints [rad, m].
    """
    coupling = chain.coupling
    if coupling is None:
        return q
    offset = ca.DM(coupling.offset)
    if chain.floating:
        offset = ca.vertcat(ca.DM.zeros(BASE_FREEDOM), offset)
    return all_rates(chain, q) + offset


def all_rates(chain: Chain, rate: Matrix) -> Matrix:
    """A x, for velocities or accelerations of the independent joints.

    Args:
        chain: N joints, n of them independent.
        rate: (n,) [rad/s, m/s] or higher derivatives.

    Returns:
        (N,) of all joints.
    """
    return rate if chain.coupling is None else ca.mtimes(_matrix(chain), rate)


def independent_forces(chain: Chain, force: Matrix) -> Matrix:
    """Aᵀ τ_all: generalised forces of the independent joints, by virtual power.

    Args:
        chain: N joints, n of them independent.
        force: (N, m) generalised forces of all joints [N·m, N].

    Returns:
        (n, m) [N·m, N].
    """
    return force if chain.coupling is None else ca.mtimes(_matrix(chain).T, force)


def independent_mass(chain: Chain, mass: Matrix) -> Matrix:
    """Aᵀ M_all A, symmetric to the bit.

    Args:
        chain: N joints, n of them independent.
        mass: (N, N) mass matrix of all joints.

    Returns:
        (n, n) mass matrix of the independent joints.
    """
    if chain.coupling is None:
        return mass
    full = independent_forces(chain, ca.mtimes(mass, _matrix(chain)))
    upper = ca.triu(full)  # the lower triangle is a copy: sums in another order would differ
    return upper + ca.triu(full, False).T


def _matrix(chain: Chain) -> Matrix:
    if chain.coupling is None:
        return ca.DM()
    matrix = ca.DM(chain.coupling.matrix)
    return ca.sparsify(ca.diagcat(ca.DM.eye(BASE_FREEDOM), matrix) if chain.floating else matrix)
