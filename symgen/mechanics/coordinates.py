"""Independent coordinates of a `Chain`: q_all = A q + b, τ = Aᵀ τ_all, M = Aᵀ M_all A.

The recursions of the other modules run over all joints; these maps lead in and out of them. Where
every joint is independent they return their argument itself, so that no operation is added.
"""

import casadi as ca

from symgen.chain import Chain
from symgen.kernel import Matrix


def all_positions(chain: Chain, q: Matrix) -> Matrix:
    """q_all = A q + b.

    Args:
        chain: N joints, n of them independent.
        q: (n,) positions of the independent joints [rad, m].

    Returns:
        (N,) positions of all joints [rad, m].
    """
    coupling = chain.coupling
    return q if coupling is None else all_rates(chain, q) + ca.DM(coupling.offset)


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
    return ca.sparsify(ca.DM(chain.coupling.matrix)) if chain.coupling else ca.DM()
