"""Kernels of one body: maps between λ, π and the matrices of its inertia."""

import casadi as ca

from symgen import inertia
from symgen.inertia import N_PARAMETERS as P
from symgen.kernel import Argument, Kernel, make_kernel


def body_kernels() -> tuple[Kernel, ...]:
    """Everything about one body."""
    pi_, lam_ = Argument("pi", (P,), "SI"), Argument("lam", (P,), "lambda")
    floor_ = Argument("floor", (1,), "1", shared=True)
    slope_ = Argument("slope", (P,), "d cost / d pi")
    pi, lam, floor, slope = (a.symbol() for a in (pi_, lam_, floor_, slope_))
    return (
        make_kernel(
            "pi_from_lam", {lam_: lam}, {pi_: inertia.pi_from_lam(lam)}, "Eqs. 4.25-4.31", "link"
        ),
        make_kernel(
            "pi_jacobian",
            {lam_: lam},
            {
                pi_: inertia.pi_from_lam(lam),
                Argument("jacobian", (P, P), "d pi / d lam"): ca.jacobian(
                    inertia.pi_from_lam(lam), lam
                ),
            },
            "pi and d pi / d lam of one link",
            "link",
        ),
        make_kernel(
            "pi_adjoint",
            {lam_: lam, slope_: slope},
            {
                Argument("gradient", (P,), "d cost / d lam"): ca.jtimes(
                    inertia.pi_from_lam(lam), lam, slope, True
                )
            },
            "(d pi / d lam)' slope of one link, Eq. 4.32",
            "link",
        ),
        make_kernel(
            "lam_from_pi",
            {pi_: pi},
            {lam_: inertia.lam_from_pi(pi)},
            "Eqs. 4.18-4.23",
            "link",
            rare=True,
        ),
        make_kernel(
            "nearest_realisable",
            {pi_: pi, floor_: floor},
            {Argument("realisable", (P,), "SI"): inertia.nearest_realisable(pi, floor)},
            "pi with the eigenvalues of Sigma_com raised to floor * trace + m (1 mm)^2",
            "link",
            rare=True,
        ),
        make_kernel(
            "inertia_matrix",
            {lam_: lam},
            {Argument("M", (6, 6), "SI"): inertia.spatial_inertia(lam)},
            "M(lam), Eq. 4.14 (linear part first)",
            "link",
            rare=True,
        ),
        make_kernel(
            "pseudo_inertia",
            {pi_: pi},
            {Argument("P", (4, 4), "SI"): inertia.pseudo_inertia(pi)},
            "P(pi), Eqs. 3.9, 3.10",
            "link",
            rare=True,
        ),
    )
