"""Kernels that model-based controllers call beside τ, M(q) and h(q, dq).

A controller calls them once per period, so that no vector code is compiled for them.
"""

from collections.abc import Container

from symgen.catalogue.units import STATE, state_unit
from symgen.chain import Chain
from symgen.kernel import Argument, Kernel, make_kernel
from symgen.mechanics import dynamics, kinematics, mass_matrix
from symgen.mechanics.base_parameters import regrouped
from symgen.mechanics.inertia import N_PARAMETERS


def control_kernels(chain: Chain, omitted: Container[str] = ()) -> tuple[Kernel, ...]:
    """Return the kernels of computed-torque, adaptive and impedance controllers."""
    n, links = chain.freedom, len(chain.joints)
    q_, dq_ = (Argument(STATE[k], (n,), state_unit(chain, k)) for k in range(2))
    dq_r_ = Argument("dq_r", (n,), state_unit(chain, 1))
    ddq_r_ = Argument("ddq_r", (n,), state_unit(chain, 2))
    pi_ = Argument("pi", (N_PARAMETERS * links,), "SI", shared=True)
    q, dq, dq_r, ddq_r, pi = (a.symbol() for a in (q_, dq_, dq_r_, ddq_r_, pi_))
    jacobians = make_kernel(
        "frame_jacobians",
        {q_: q},
        {Argument("J", (6 * (links + 1), n), "m|1"): kinematics.frame_jacobians(chain, q)},
        "linear, then angular velocity J dq of the frames of all links and of the tip, in axes "
        "of the base, one below the other",
        rare=True,
        unhurried=True,
    )
    if chain.floating:
        return (jacobians,)
    bound = make_kernel(
        "mobility_bound",
        {pi_: pi},
        {Argument("S", (links, links), "d ddq / d tau"): mass_matrix.mobility_bound(chain, pi)},
        "S = B I^-1 B', the inverse of M(q) of all joints is at most S for every q",
        rare=True,
        unhurried=True,
    )
    if "coriolis_matrix" in omitted:
        return (jacobians, bound)
    return (
        make_kernel(
            "coriolis_matrix",
            {q_: q, dq_: dq, pi_: pi},
            {
                Argument("C", (n, n), "d (C dq) / d dq / 2"): dynamics.coriolis_matrix(
                    chain, q, dq, regrouped(chain, pi)
                )
            },
            "C(q, dq) of Christoffel symbols: h = C dq - tau_grav, dM/dt - 2 C is skew-symmetric",
            rare=True,
            unhurried=True,
        ),
        make_kernel(
            "slotine_li_regressor",
            {q_: q, dq_: dq, dq_r_: dq_r, ddq_r_: ddq_r},
            {
                Argument("Y", (n, N_PARAMETERS * links), "d tau / d pi"): (
                    dynamics.slotine_li_regressor(chain, q, dq, dq_r, ddq_r)
                )
            },
            "Y pi = M(q) ddq_r + C(q, dq) dq_r - tau_grav(q), Slotine & Li 1987",
            rare=True,
            unhurried=True,
        ),
        jacobians,
        bound,
    )
