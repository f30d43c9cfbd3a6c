"""Physical consistency of one body: pseudo-inertia P ⪰ 0, its barrier, log-Cholesky, projection.

A body of positive density has m > 0 and Σ_com ⪰ 0, which is P(π) ⪰ 0 (Eqs. 3.9, 3.10).
Source: document Sec. 3.3; Wensing, Kim & Slotine, IEEE RA-L 3(1), 2018; Rucker & Wensing, 2022.
"""

import casadi as ca

from symgen.errors import InertiaError
from symgen.kernel import Matrix
from symgen.mechanics.inertia import (
    N_PARAMETERS,
    REALISABLE_TOLERANCE,
    SHIFT_TOLERANCE,
    com_inertia,
    mass_moment_inertia,
    pi_from_com,
    pi_of_body,
    principal_sigma,
)

THINNEST = 1e-3
"""Smallest standard deviation of mass along an axis that a projected body may have, m."""


def pseudo_inertia(pi: Matrix) -> Matrix:
    """P = [[Σ, mc], [mcᵀ, m]] with Σ = ½ tr(I) 1 − I; P ⪰ 0 is full physical consistency.

    Source: Eqs. 3.9, 3.10.

    pi (10,) → (4, 4) [kg·m², kg·m, kg].
    """
    mass, moment, inertia = mass_moment_inertia(pi)
    sigma = ca.trace(inertia) / 2 * ca.DM.eye(3) - inertia
    return ca.vertcat(ca.horzcat(sigma, moment), ca.horzcat(moment.T, mass))


def barrier(pi: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Smallest pivot of P = L D Lᵀ, log det P, tr(P⁻¹ B_i) and tr(P⁻¹ B_i P⁻¹ B_j), B_i = ∂P/∂π_i.

    P is positive definite where the pivot is positive; elsewhere the other outputs have no meaning.
    P is linear in π, so the traces are the gradient of log det P and minus its Hessian.

    pi (10,) → (10,).
    """
    p = pseudo_inertia(pi)
    size = p.shape[0]
    # P = L D Lᵀ column by column, without square roots: an indefinite P gives a negative pivot.
    lower = ca.SX.eye(size)
    pivots: list[Matrix] = []
    for j in range(size):
        pivots.append(p[j, j] - sum(lower[j, k] ** 2 * pivots[k] for k in range(j)))
        for i in range(j + 1, size):
            inner = sum(lower[i, k] * lower[j, k] * pivots[k] for k in range(j))
            lower[i, j] = (p[i, j] - inner) / pivots[j]
    left = ca.SX.eye(size)  # L⁻¹ by forward substitution; P⁻¹ = L⁻ᵀ D⁻¹ L⁻¹
    for j in range(size):
        for i in range(j + 1, size):
            left[i, j] = -sum(lower[i, k] * left[k, j] for k in range(j, i))
    inverse = ca.mtimes([left.T, ca.diag(ca.vertcat(*(1 / d for d in pivots))), left])
    # B_i = ∂P/∂π_i is constant; tr(P⁻¹ B_i P⁻¹ B_j) needs each product P⁻¹ B_i once.
    basis = [ca.reshape(column, size, size) for column in ca.horzsplit(ca.jacobian(ca.vec(p), pi))]
    moved = [ca.mtimes(inverse, b) for b in basis]
    traces = ca.vertcat(*(ca.trace(m) for m in moved))
    curvature = ca.SX(N_PARAMETERS, N_PARAMETERS)
    for i, first in enumerate(moved):
        for j, second in enumerate(moved[: i + 1]):
            curvature[i, j] = curvature[j, i] = ca.dot(first, second.T)
    smallest = ca.fmin(ca.fmin(pivots[0], pivots[1]), ca.fmin(pivots[2], pivots[3]))
    return smallest, ca.log(pivots[0] * pivots[1] * pivots[2] * pivots[3]), traces, curvature


def pi_from_cholesky(theta: Matrix) -> Matrix:
    """π from log-Cholesky θ = (α, d1, d2, d3, s12, s23, s13, t1, t2, t3): P = U Uᵀ, P ≻ 0 always.

    U = e^α [[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]].

    Source: Rucker & Wensing, Smooth parameterization of rigid-body inertia, 2022.

    theta (10,) → (10,).
    """
    d1, d2, d3 = (ca.exp(theta[i]) for i in (1, 2, 3))
    s12, s23, s13, t = theta[4], theta[5], theta[6], theta[7:10]
    upper = ca.vertcat(
        ca.horzcat(d1, s12, s13, t[0]),
        ca.horzcat(0, d2, s23, t[1]),
        ca.horzcat(0, 0, d3, t[2]),
    )
    mass = ca.exp(2 * theta[0])
    sigma = ca.mtimes(upper, upper.T)
    return pi_of_body(mass, mass * t, mass * (ca.trace(sigma) * ca.DM.eye(3) - sigma))


def cholesky_from_pi(pi: Matrix) -> Matrix:
    """θ of `pi_from_cholesky` from π; NaN where P is not positive definite.

    pi (10,) → (10,).
    """
    mass, com, inertia = com_inertia(pi)
    sigma = (ca.trace(inertia) / 2 * ca.DM.eye(3) - inertia) / mass
    u33 = ca.sqrt(sigma[2, 2])
    u23, u13 = sigma[1, 2] / u33, sigma[0, 2] / u33
    u22 = ca.sqrt(sigma[1, 1] - u23**2)
    u12 = (sigma[0, 1] - u13 * u23) / u22
    u11 = ca.sqrt(sigma[0, 0] - u12**2 - u13**2)
    return ca.vertcat(ca.log(mass) / 2, ca.log(u11), ca.log(u22), ca.log(u33), u12, u23, u13, com)


def nearest_realisable(pi: Matrix, floor: Matrix) -> Matrix:
    """π with the eigenvalues of Σ_com raised to a floor: the nearest such matrix (Frobenius).

    Mass and centre of mass are kept.

    pi (10,) → (10,).
    """
    mass, com, rotation, sigma, _ = principal_sigma(pi)
    least = floor * sum(ca.fmax(sigma[i], 0) for i in range(3)) + mass * THINNEST**2
    s = [ca.fmax(sigma[i], least) for i in range(3)]
    moments = ca.diag(ca.vertcat(s[1] + s[2], s[2] + s[0], s[0] + s[1]))
    return pi_from_com(mass, com, ca.mtimes([rotation, moments, rotation.T]))


def require_realisable(pi: Matrix, link: str) -> None:
    """Check that a numeric π is physically consistent."""
    mass = float(pi[0])
    if not mass > 0:
        raise InertiaError(
            f"link '{link}' needs a positive mass, got {mass:g} kg; correct its <inertial>"
        )
    _, com, _, sigma, trace = principal_sigma(ca.DM(pi))
    slack = 2 * min(float(sigma[i]) for i in range(3))
    shift = SHIFT_TOLERANCE * mass * float(ca.sumsqr(com))
    if not float(trace) > shift:
        raise InertiaError(
            f"link '{link}' has a mass but zero inertia, which is not physically consistent; "
            "correct the URDF, or accept the smallest consistent inertia with --project"
        )
    if not slack >= -(REALISABLE_TOLERANCE * float(trace) + shift):
        raise InertiaError(
            f"the inertia of link '{link}' is not physically consistent: one principal moment "
            f"exceeds the sum of the other two by {-slack:.3g} kg*m^2; correct the URDF, or accept "
            "the nearest consistent inertia with --project"
        )
