"""Kernels of the robot's motion: torques, regressors, mass matrix, springs, terms of controllers.

Those of controllers are called once per period, so that no vector code is compiled for them.
"""

from collections.abc import Callable, Container
from typing import Any

import casadi as ca

from symgen.chain import Chain
from symgen.kernel import Argument, Array, Kernels, make_kernel, make_rare, make_slow
from symgen.mechanics import dynamics, kinematics, passive
from symgen.mechanics.base_parameters import BaseParameters, regrouped
from symgen.mechanics.inertia import N_PARAMETERS as P

STATE = ("q", "dq", "ddq", "dddq", "ddddq")  # positions and their time derivatives


def motion_kernels(chain: Chain, base: BaseParameters, omitted: Container[str] = ()) -> Kernels:
    """Return the kernels of τ(q, dq, ddq) and its parameters."""
    n, b, links = chain.freedom, len(base.columns), len(chain.joints)
    effort = effort_unit(chain)
    motion = motion_of(chain, 3)
    (q_, dq_, ddq_), (q, dq, ddq) = motion, motion.values()
    tau_, pi_ = Argument("tau", (n,), effort), Argument("pi", (P * links,), "SI", shared=True)
    beta_ = Argument("beta", (b,), "SI", shared=True)
    lam_ = Argument("lam", (P * links,), "lambda", shared=True)
    weight_ = Argument("weight", (n,), "1", shared=True)
    rotor_ = Argument("rotor", (n,), inertia_unit(chain), shared=True)
    further = (tau_, pi_, beta_, lam_, weight_, rotor_)
    tau, pi, beta, lam, weight, rotor = (a.symbol() for a in further)
    with_pi, with_lam = motion | {pi_: pi}, motion | {lam_: lam}
    # τ(π) = τ(β(π)): through β where the regrouping loses nothing, else from regrouped π.
    grouped = regrouped(chain, pi)
    predicted = dynamics.inverse_dynamics(chain, q, dq, ddq, grouped)
    expanded = ca.SX(P * links, 1)  # a π with the base parameters β
    expanded[list(base.columns)] = beta
    from_base = dynamics.inverse_dynamics(chain, q, dq, ddq, expanded)
    to_base = ("base_parameters", "base_inverse_dynamics")
    torque = ca.substitute(from_base, beta, _times(base.matrix, dynamics.pi_from_lam_all(lam)))
    # `base_parameters` and `base_adjoint` run per parameter vector: nothing is shared by samples.
    pi_once_, beta_once_ = Argument("pi", (P * links,), "SI"), Argument("beta", (b,), "SI")
    slope_ = Argument("slope", (b,), "d cost / d beta")
    pi_once, slope_of_beta = pi_once_.symbol(), slope_.symbol()
    adjoint = _times(base.matrix.T, slope_of_beta)
    jacobian = dynamics.torque_jacobian(chain, q, dq, ddq, lam)
    columns = dynamics.regressor(chain, q, dq, ddq, base.columns)
    residual = from_base - tau
    loss = ca.dot(residual, weight * residual) / 2
    slope = ca.jtimes(from_base, beta, weight * residual, True)
    return (
        make_kernel(
            "base_inverse_dynamics",
            motion | {beta_: beta},
            {tau_: from_base},
            "tau = Y_b(q, dq, ddq) beta, Eq. 3.11",
        ),
        make_kernel(
            "inverse_dynamics",
            with_pi,
            {tau_: predicted},
            "tau = Y(q, dq, ddq) pi, Eq. 4.3",
            through=to_base if base.lossless else (),
        ),
        make_kernel(
            "torque",
            with_lam,
            {tau_: torque},
            "tau = Y(q, dq, ddq) pi(lam), Eq. 4.3",
            through=("pi_from_lam", *to_base),
        ),
        make_kernel(
            "regressor",
            motion,
            {Argument("Y", (n, P * links), "d tau / d pi"): dynamics.regressor(chain, q, dq, ddq)},
            "Y with tau = Y pi, Eq. 3.1",
        ),
        make_kernel(
            "torque_jacobian",
            with_lam,
            {Argument("jacobian", (n, P * links), "d tau / d lam"): jacobian},
            "d tau / d lam = Y blockdiag(d pi / d lam), Eqs. 4.34-4.36",
            factors=("regressor", "pi_jacobian"),
        ),
        make_kernel(
            "base_regressor",
            motion,
            {Argument("Y_b", (n, b), "d tau / d beta"): columns},
            "Y_b with tau = Y_b beta, Eq. 3.11",
        ),
        *(() if "momentum_regressor" in omitted else _without_accelerations(chain, base)),
        make_kernel(
            "base_parameters",
            {pi_once_: pi_once},
            {beta_once_: _times(base.matrix, pi_once)},
            "beta = K pi, Eq. 3.11",
        ),
        make_kernel(
            "base_adjoint",
            {slope_: slope_of_beta},
            {Argument("gradient", (P * links,), "d cost / d pi"): adjoint},
            "K' slope, the adjoint of beta = K pi",
        ),
        make_kernel(
            "mass_matrix",
            {q_: q, pi_: pi},
            {Argument("M", (n, n), "d tau / d ddq"): dynamics.mass_matrix(chain, q, grouped)},
            "M(q), Eq. 2.34",
        ),
        make_kernel(
            "bias_forces",
            {q_: q, dq_: dq, pi_: pi},
            {Argument("h", (n,), effort): dynamics.bias_forces(chain, q, dq, grouped)},
            "h = C(q, dq) dq - tau_grav, Eq. 2.34",
            through=("inverse_dynamics",),
        ),
        make_kernel(
            "forward_dynamics",
            {q_: q, dq_: dq, tau_: tau, pi_: pi, rotor_: rotor},
            {ddq_: dynamics.forward_dynamics(chain, q, dq, tau, grouped, rotor)},
            "ddq = (M + diag(J))^-1 (tau - h), J of the rotors",
        ),
        make_kernel(
            "end_effector",
            {q_: q},
            {Argument("H", (4, 4), "1|m"): kinematics.end_effector(chain, q)},
            "pose of the tip in the base frame, Eq. 2.15",
        ),
        make_rare(
            "link_poses",
            {q_: q},
            {Argument("H", (4 * links, 4), "1|m"): kinematics.link_poses(chain, q)},
            "poses of the links in the base frame, one below the other, Eq. 2.15",
        ),
        make_kernel(
            "loss_gradient",
            motion | {tau_: tau, weight_: weight, beta_: beta},
            {
                Argument("loss", (1,), "1", summed=True): loss,
                Argument("gradient", (b,), "d loss / d beta", summed=True): slope,
                Argument("residual", (n,), effort): residual,
            },
            "sum of r'Wr/2 and of Y_b'Wr, r = Y_b beta - tau, Eqs. 4.6, 4.32",
            unhurried=True,  # loops call its tiles
        ),
    )


def _without_accelerations(chain: Chain, base: BaseParameters) -> Kernels:
    """Regressors of momentum and energy."""
    n, b, motion = chain.freedom, len(base.columns), motion_of(chain, 2)

    def columns(f: Callable[..., Any]) -> Any:
        return dynamics.by_parameters(
            chain, lambda pi: f(chain, *motion.values(), pi), base.columns
        )

    return (
        make_kernel(
            "momentum_regressor",
            motion,
            {
                Argument("P_b", (n, b), "d p / d beta"): columns(dynamics.momentum),
                Argument("R_b", (n, b), "d r / d beta"): columns(dynamics.lagrange_force),
            },
            "tau = d(P_b beta)/dt - R_b beta, p = M dq = P_b beta, r = d(T - U)/dq = R_b beta",
            unhurried=True,  # loops call its tiles
        ),
        make_rare(
            "energy_regressor",
            motion,
            {
                Argument("E_b", (b,), "d (T + U) / d beta"): columns(
                    lambda *of: sum(dynamics.energies(*of))
                ).T
            },
            "dq.tau = d(E_b beta)/dt, T + U = E_b beta + const",
        ),
    )


def _times(matrix: Array, vector: Any) -> Any:
    """matrix · vector without the zeros of the matrix."""
    return ca.mtimes(ca.sparsify(ca.DM(matrix)), vector)


def motion_of(chain: Chain, count: int) -> dict[Argument, Any]:
    """The first of q, dq, ddq, … of all joints, as arguments with new symbols."""
    arguments = (Argument(STATE[k], (chain.freedom,), state_unit(chain, k)) for k in range(count))
    return {a: a.symbol() for a in arguments}


def state_unit(chain: Chain, power: int) -> str:
    """Unit of a time derivative of q of all joints."""
    kinds = {"m" if slides else "rad" for slides in _slides(chain)}
    return "|".join(sorted(kinds)) + ("", "/s", "/s^2", "/s^3", "/s^4")[power]


def effort_unit(chain: Chain) -> str:
    """Unit of τ of all joints: "N*m", "N" or both."""
    return "|".join({True: "N", False: "N*m"}[s] for s in _slides(chain))


def inertia_unit(chain: Chain) -> str:
    """Unit of the inertia of the rotors of all joints: "kg*m^2", "kg" or both."""
    return "|".join({True: "kg", False: "kg*m^2"}[s] for s in _slides(chain))


def _slides(chain: Chain) -> list[bool]:
    if chain.floating:  # slides and turns
        return [False, True]
    return sorted({j.kind == "prismatic" for j in chain.coordinates})


def passive_kernels(chain: Chain) -> Kernels:
    """Return the kernels of torques that depend on q alone."""
    n, kernels, motion = len(chain.coordinates), [], motion_of(chain, 1)
    (q,) = motion.values()
    springs = passive.unknown_springs(chain)
    if springs:
        kernels.append(
            make_rare(
                "spring_columns",
                motion,
                {Argument("S", (n, len(springs)), "d tau / d k"): passive.spring_columns(chain, q)},
                "tau = S k of the springs, S = (x - rest) dx / dq",
            )
        )
    if len(springs) < len(chain.mechanism.spring) or chain.mechanism.known_torque:
        kernels.append(
            make_rare(
                "known_torque",
                motion,
                {Argument("tau", (n,), effort_unit(chain)): passive.known_torque(chain, q)},
                "tau = p(x) dx / dq of torque curves and of springs of known stiffness",
            )
        )
    return tuple(kernels)


def control_kernels(chain: Chain, omitted: Container[str] = ()) -> Kernels:
    """Return the kernels of computed-torque, adaptive and impedance controllers."""
    n, links = chain.freedom, len(chain.joints)
    motion = motion_of(chain, 2)
    (q_, _), (q, dq) = motion, motion.values()
    dq_r_ = Argument("dq_r", (n,), state_unit(chain, 1))
    ddq_r_ = Argument("ddq_r", (n,), state_unit(chain, 2))
    pi_ = Argument("pi", (P * links,), "SI", shared=True)
    dq_r, ddq_r, pi = (a.symbol() for a in (dq_r_, ddq_r_, pi_))
    jacobians = make_slow(
        "frame_jacobians",
        {q_: q},
        {Argument("J", (6 * (links + 1), n), "m|1"): kinematics.frame_jacobians(chain, q)},
        "linear, then angular velocity J dq of the frames of all links and of the tip, in axes "
        "of the base, one below the other",
    )
    if chain.floating:
        return (jacobians,)
    bound = make_slow(
        "mobility_bound",
        {pi_: pi},
        {Argument("S", (links, links), "d ddq / d tau"): dynamics.mobility_bound(chain, pi)},
        "S = B I^-1 B', the inverse of M(q) of all joints is at most S for every q",
    )
    if "coriolis_matrix" in omitted:
        return (jacobians, bound)
    coriolis = dynamics.coriolis_matrix(chain, q, dq, regrouped(chain, pi))
    regressor = dynamics.slotine_li_regressor(chain, q, dq, dq_r, ddq_r)
    return (
        make_slow(
            "coriolis_matrix",
            motion | {pi_: pi},
            {Argument("C", (n, n), "d (C dq) / d dq / 2"): coriolis},
            "C(q, dq) of Christoffel symbols: h = C dq - tau_grav, dM/dt - 2 C is skew-symmetric",
        ),
        make_slow(
            "slotine_li_regressor",
            motion | {dq_r_: dq_r, ddq_r_: ddq_r},
            {Argument("Y", (n, P * links), "d tau / d pi"): regressor},
            "Y pi = M(q) ddq_r + C(q, dq) dq_r - tau_grav(q), Slotine & Li 1987",
        ),
        jacobians,
        bound,
    )
