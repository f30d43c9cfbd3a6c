"""Inertial parameters of one body: π, λ, M(λ), the maps between them, physical consistency.

π = [m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ], inertia about the *link origin* (Eq. 3.3);
λ = [μ, x, y, z, ω1, ω2, ω3, a, b, c] (Eq. 4.13). Both orders are defined here and nowhere else.
π is in kg, kg·m and kg·m²; λ in ln kg, m, rad and kg^½·m; c (3,) and I (3, 3) are of one body.
Every λ is physically consistent: m = e^μ > 0 and Σ_com = R diag(a², b², c²) Rᵀ ⪰ 0, which is
P(π) ⪰ 0 of the pseudo-inertia (Eqs. 3.9, 3.10).
Source: document Sec. 3.3 and 4.3 with the errata to Eqs. 2.27, 2.28, 4.14, 4.20; Wensing, Kim &
Slotine, IEEE RA-L 3(1), 2018; Rucker & Wensing, 2022.
"""

import casadi as ca

from symgen.errors import InertiaError
from symgen.kernel import Matrix
from symgen.mechanics.spatial import exp_so3, log_so3, so3_coefficients, symmetric_eigen

PI_NAMES = ("m", "mX", "mY", "mZ", "XX", "YY", "ZZ", "XY", "XZ", "YZ")
PI_UNITS = ("kg", *("kg*m",) * 3, *("kg*m^2",) * 6)
LAM_NAMES = ("mu", "x", "y", "z", "omega1", "omega2", "omega3", "a", "b", "c")
LAM_UNITS = ("ln(kg)", *("m",) * 3, *("rad",) * 3, *("kg^0.5*m",) * 3)
N_PARAMETERS = len(PI_NAMES)
REALISABLE_TOLERANCE = 1e-12
"""Rounding error of the triangle inequality, relative to the trace of I_com.

Eigenvalues of Σ_com between minus this and zero count as zero.
"""
SHIFT_TOLERANCE = 16 * 2.0**-52
"""Rounding error of I_com after m|c|² is subtracted, relative to m|c|².

m|c|² may exceed the inertia of a thin body by orders of magnitude.
"""
MassMoments = tuple[Matrix, Matrix, Matrix]
"""(m, m·c, I): () kg, (3,) kg·m, (3, 3) kg·m² about the origin of a frame."""
THINNEST = 1e-3  # least standard deviation of mass along an axis that a projected body may have, m


def mass_moment_inertia(pi: Matrix) -> MassMoments:
    """m, m·c and I about the link origin of one body."""
    xx, yy, zz, xy, xz, yz = (pi[i] for i in range(4, 10))
    inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return pi[0], pi[1:4], inertia


def bodies_of(pi: Matrix) -> list[MassMoments]:
    """Return the bodies of all links."""
    links = range(0, pi.numel(), N_PARAMETERS)
    return [mass_moment_inertia(pi[k : k + N_PARAMETERS]) for k in links]


def sum_of_bodies(a: MassMoments, b: MassMoments) -> MassMoments:
    """Return the sum of two bodies given in the same frame."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def pi_of_body(mass: Matrix, moment: Matrix, inertia: Matrix) -> Matrix:
    """π of m, m·c and I about the link origin."""
    i = inertia
    return ca.vertcat(mass, moment, i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])


def pi_from_com(mass: Matrix, com: Matrix, inertia_com: Matrix) -> Matrix:
    """π of a body given at its centre of mass: I = I_com − m [c×]² (Eq. 4.30)."""
    return pi_of_body(mass, mass * com, inertia_com - mass * ca.mtimes(ca.skew(com), ca.skew(com)))


def in_parent_frame(rotation: Matrix, translation: Matrix, body: MassMoments) -> MassMoments:
    """A body in the parent frame, in which its own frame has the pose (R, p).

    With h = R m c: m c' = h + m p and I' = R I Rᵀ + (2 p·h + m p·p) 1 − p s' − s p', s = h + m p/2.
    This is Steiner's theorem, Eq. 4.30, without c, which a body of zero mass does not have.
    """
    mass, moment, inertia = body
    h, p = ca.mtimes(rotation, moment), translation
    half = h + mass * p / 2
    longest = 2 * ca.dot(p, h) + mass * ca.dot(p, p)
    turned: Matrix = ca.mtimes(rotation, inertia)
    moved = ca.SX(3, 3)
    for i in range(3):
        for j in range(i + 1):
            entry = ca.mtimes(turned[i, :], rotation[j, :].T) - p[i] * half[j] - half[i] * p[j]
            moved[i, j] = moved[j, i] = entry + longest if i == j else entry
    return mass, h + mass * p, moved


def com_inertia(pi: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """m, c and I_com = I + m [c×]² (Eq. 4.20, errata)."""
    mass, moment, inertia = mass_moment_inertia(pi)
    com = moment / mass
    return mass, com, inertia + mass * ca.mtimes(ca.skew(com), ca.skew(com))


def pi_from_lam(lam: Matrix) -> Matrix:
    """π from λ: m = e^μ, I_com = R diag(b²+c², c²+a², a²+b²) Rᵀ, I = I_com − m [c×]²."""
    mass, com, rotation = ca.exp(lam[0]), lam[1:4], exp_so3(lam[4:7])
    a2, b2, c2 = lam[7] ** 2, lam[8] ** 2, lam[9] ** 2
    moments = ca.diag(ca.vertcat(b2 + c2, c2 + a2, a2 + b2))
    return pi_from_com(mass, com, ca.mtimes([rotation, moments, rotation.T]))


def lam_frame(lam: Matrix) -> Matrix:
    """Intermediate values of `pi_from_lam` for `pi_adjoint`, (12,): m, R by columns, B and C."""
    _, b, c = so3_coefficients(lam[4:7])
    return ca.vertcat(ca.exp(lam[0]), ca.vec(exp_so3(lam[4:7])), b, c)


def pi_adjoint(lam: Matrix, frame: Matrix, slope: Matrix) -> Matrix:
    """(∂π/∂λ)ᵀ slope in closed form, at a third of the cost of reverse differentiation.

    With S the symmetric matrix for which slope[4:] · π[4:] = tr(S I) and T = Rᵀ S R:
    ∂a = 2a (T₂₂ + T₃₃), ∂c = m (slope[1:4] + 2 (tr(S) 1 − S) c), and a turn δφ in the frame of
    the axes of inertia changes tr(S I) by 2 ((c² − b²) T₂₃, (a² − c²) T₁₃, (b² − a²) T₁₂) · δφ,
    where δφ = (1 − B [ω×] + C [ω×]²) δω.
    """
    com, omega, axes = lam[1:4], lam[4:7], lam[7:10]
    mass, rotation, b, c = frame[0], ca.reshape(frame[1:10], 3, 3), frame[10], frame[11]
    xx, yy, zz = (slope[i] for i in (4, 5, 6))
    xy, xz, yz = (slope[i] / 2 for i in (7, 8, 9))
    s = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    # I = R I_p Rᵀ − m [c×]²: ∂tr(S I)/∂c = 2 m (tr(S) 1 − S) c, and T = Rᵀ S R gives the rest.
    shift = ca.trace(s) * com - ca.mtimes(s, com)
    turned = ca.mtimes(s, rotation)
    t = [[ca.dot(rotation[:, i], turned[:, j]) for j in range(3)] for i in range(3)]
    squares = [axes[i] ** 2 for i in range(3)]
    torque = ca.vertcat(
        2 * (squares[2] - squares[1]) * t[1][2],
        2 * (squares[0] - squares[2]) * t[0][2],
        2 * (squares[1] - squares[0]) * t[0][1],
    )
    # Transpose of the right Jacobian: (1 + B [ω×] + C [ω×]²) torque.
    once = ca.cross(omega, torque)
    return ca.vertcat(
        mass * (slope[0] + ca.dot(com, slope[1:4] + shift)),
        mass * (slope[1:4] + 2 * shift),
        torque + b * once + c * ca.cross(omega, once),
        2 * axes[0] * (t[1][1] + t[2][2]),
        2 * axes[1] * (t[2][2] + t[0][0]),
        2 * axes[2] * (t[0][0] + t[1][1]),
    )


def principal_sigma(pi: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix, Matrix]:
    """m, c, R, the eigenvalues (a², b², c²) of Σ_com = ½ tr(I_com) 1 − I_com, and tr(I_com)."""
    mass, com, inertia = com_inertia(pi)
    moments, rotation = symmetric_eigen(inertia)
    j1, j2, j3 = moments[0], moments[1], moments[2]
    sigma = ca.vertcat((j2 - j1) + j3, (j1 - j2) + j3, j1 + (j2 - j3)) / 2
    return mass, com, rotation, sigma, j1 + j2 + j3


def lam_from_pi(pi: Matrix) -> Matrix:
    """λ from π, a ≥ b ≥ c ≥ 0, NaN where not realisable. Eqs. 4.18–4.23, Table B.5 (errata)."""
    mass, com, rotation, sigma, trace = principal_sigma(pi)
    rounding = REALISABLE_TOLERANCE * trace + SHIFT_TOLERANCE * mass * ca.sumsqr(com)
    clipped = [
        ca.if_else(ca.logic_and(sigma[i] < 0, sigma[i] > -rounding), 0.0, sigma[i])
        for i in range(3)
    ]
    for i in (1, 2):  # equal moments: rounding of the sums above may turn the order around
        clipped[i] = ca.fmin(clipped[i], clipped[i - 1])
    return ca.vertcat(ca.log(mass), com, log_so3(rotation), *(ca.sqrt(s) for s in clipped))


def spatial_inertia(lam: Matrix) -> Matrix:
    """M(λ) = [[m 1, [mc×]ᵀ], [[mc×], I]], (6, 6), linear part first (Eq. 4.14, errata)."""
    mass, moment, inertia = mass_moment_inertia(pi_from_lam(lam))
    h = ca.skew(moment)
    return ca.vertcat(ca.horzcat(mass * ca.DM.eye(3), h.T), ca.horzcat(h, inertia))


def pseudo_inertia(pi: Matrix) -> Matrix:
    """P = [[Σ, mc], [mcᵀ, m]], (4, 4), with Σ = ½ tr(I) 1 − I (Eqs. 3.9, 3.10)."""
    mass, moment, inertia = mass_moment_inertia(pi)
    sigma = ca.trace(inertia) / 2 * ca.DM.eye(3) - inertia
    return ca.vertcat(ca.horzcat(sigma, moment), ca.horzcat(moment.T, mass))


def barrier(pi: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Smallest pivot of P = L D Lᵀ, log det P, tr(P⁻¹ B_i) and tr(P⁻¹ B_i P⁻¹ B_j), B_i = ∂P/∂π_i.

    P is positive definite where the pivot is positive; elsewhere the other outputs have no meaning.
    P is linear in π, so the traces are the gradient of log det P and minus its Hessian.
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
    """
    d1, d2, d3 = (ca.exp(theta[i]) for i in (1, 2, 3))
    s12, s23, s13, t = theta[4], theta[5], theta[6], theta[7:10]
    upper = ca.vertcat(
        ca.horzcat(d1, s12, s13, t[0]), ca.horzcat(0, d2, s23, t[1]), ca.horzcat(0, 0, d3, t[2])
    )
    mass = ca.exp(2 * theta[0])
    sigma = ca.mtimes(upper, upper.T)
    return pi_of_body(mass, mass * t, mass * (ca.trace(sigma) * ca.DM.eye(3) - sigma))


def cholesky_from_pi(pi: Matrix) -> Matrix:
    """θ of `pi_from_cholesky` from π; NaN where P is not positive definite."""
    mass, com, inertia = com_inertia(pi)
    sigma = (ca.trace(inertia) / 2 * ca.DM.eye(3) - inertia) / mass
    u33 = ca.sqrt(sigma[2, 2])
    u23, u13 = sigma[1, 2] / u33, sigma[0, 2] / u33
    u22 = ca.sqrt(sigma[1, 1] - u23**2)
    u12 = (sigma[0, 1] - u13 * u23) / u22
    u11 = ca.sqrt(sigma[0, 0] - u12**2 - u13**2)
    return ca.vertcat(ca.log(mass) / 2, ca.log(u11), ca.log(u22), ca.log(u33), u12, u23, u13, com)


def nearest_realisable(pi: Matrix, floor: Matrix) -> Matrix:
    """π with the eigenvalues of Σ_com raised to a floor (nearest by Frobenius), m and c kept."""
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
            "correct the URDF, or accept the smallest consistent inertia with --settings "
            "project=true"
        )
    if not slack >= -(REALISABLE_TOLERANCE * float(trace) + shift):
        raise InertiaError(
            f"the inertia of link '{link}' is not physically consistent: one principal moment "
            f"exceeds the sum of the other two by {-slack:.3g} kg*m^2; correct the URDF, or accept "
            "the nearest consistent inertia with --settings project=true"
        )
