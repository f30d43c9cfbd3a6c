"""Kernels for the design of a motion: its bases, its limits with derivatives, bounds for proofs.

Distance kernels exist only where a robot has proxies. A design spends its time in other kernels, so
most of these run sample by sample: vector code for them would double the build time.
"""

from collections.abc import Container
from itertools import islice

import casadi as ca

from symgen.catalogue.motion import STATE, effort_unit, motion_of, state_unit
from symgen.chain import Chain
from symgen.collision.distance import clearance, moving, plane_clearance
from symgen.collision.model import CollisionModel
from symgen.kernel import Argument, Kernel, Kernels, Matrix, make_kernel, make_rare, make_slow
from symgen.mechanics import derivative_bounds as bounds
from symgen.mechanics import dynamics, excitation, kinematics
from symgen.mechanics.base_parameters import BaseParameters, regrouped
from symgen.mechanics.inertia import N_PARAMETERS


def safety_kernels(
    chain: Chain, collision: CollisionModel, omitted: Container[str] = ()
) -> Kernels:
    """Return the kernels of all limits of a motion beyond those of q and its derivatives."""
    torques = () if "torque_rate" in omitted else _torques(chain)
    return (*torques, _tip(chain), *_distances(chain, collision))


def torque_derivatives(chain: Chain) -> Kernel:
    """Return the kernel of ∂τ/∂q, ∂τ/∂dq and ∂τ/∂ddq, of a free base by its coordinates."""
    n, links, motion = chain.freedom, len(chain.joints), motion_of(chain, 3)
    q, dq, ddq = motion.values()
    pi_ = Argument("pi", (N_PARAMETERS * links,), "SI", shared=True)
    pi = pi_.symbol()
    tau = dynamics.inverse_dynamics(chain, q, dq, ddq, regrouped(chain, pi))
    slope = ca.jacobian(tau, ca.vertcat(q, dq, ddq))  # shares its sweeps
    slopes = {
        Argument(name, (n, n), f"d tau / d {STATE[k]}"): slope[:, k * n : (k + 1) * n]
        for k, name in enumerate(("dtau_dq", "dtau_dv", "dtau_da"))
    }
    return make_rare(
        "torque_derivatives",
        motion | {pi_: pi},
        {Argument("tau", (n,), effort_unit(chain)): tau, **slopes},
        "tau of Eq. 4.3 and its derivatives by q, dq and ddq, the last one M(q)",
    )


def _torques(chain: Chain) -> Kernels:
    n, links, effort = len(chain.coordinates), len(chain.joints), effort_unit(chain)
    motion = motion_of(chain, 5)
    q, dq, ddq, dddq, _ = symbols = list(motion.values())
    pi_ = Argument("pi", (N_PARAMETERS * links,), "SI", shared=True)
    pi = pi_.symbol()
    with_dddq = dict(islice(motion.items(), 4)) | {pi_: pi}
    tau = dynamics.inverse_dynamics(chain, q, dq, ddq, regrouped(chain, pi))
    rate = ca.jtimes(tau, ca.vertcat(q, dq, ddq), ca.vertcat(dq, ddq, dddq))
    second = ca.jtimes(rate, ca.vertcat(*symbols[:4]), ca.vertcat(*symbols[1:]))
    seed_ = Argument("seed", (n,), "d cost / d tau_rate")
    seed = seed_.symbol()
    gradient = ca.reshape(ca.jtimes(rate, ca.vertcat(*symbols[:4]), seed, True), n, 4).T
    return (
        torque_derivatives(chain),
        make_rare(
            "torque_rate",
            with_dddq,
            {Argument("tau_rate", (n,), f"({effort})/s"): rate},
            "d tau / d t = dtau_dq dq + dtau_dv ddq + dtau_da dddq",
        ),
        make_slow(
            "torque_rate_adjoint",
            with_dddq | {seed_: seed},
            {Argument("gradient", (4, n), "d cost / d (q, dq, ddq, dddq)"): gradient},
            "d (seed . d tau / d t) / d (q, dq, ddq, dddq)",
        ),
        make_slow(
            "torque_course",
            motion | {pi_: pi},
            {
                Argument("tau", (n,), effort): tau,
                Argument("dtau", (n,), f"({effort})/s"): rate,
                Argument("ddtau", (n,), f"({effort})/s^2"): second,
            },
            "tau of Eq. 4.3 and its two first derivatives in time along a motion",
        ),
    )


def _tip(chain: Chain) -> Kernel:
    n, motion = len(chain.coordinates), motion_of(chain, 2)
    q, dq = motion.values()
    p = kinematics.end_effector(chain, q)[:3, 3]
    v = ca.jtimes(p, q, dq)
    return make_rare(
        "tip_motion",
        motion,
        {
            Argument("p", (3,), "m"): p,
            Argument("v", (3,), "m/s"): v,
            Argument("dp_dq", (3, n), "d p / d q"): ca.jacobian(p, q),
            Argument("dv_dq", (3, n), "d v / d q"): ca.jacobian(v, q),
        },
        "place and velocity v = dp_dq dq of the tip in the base frame; d v / d dq is dp_dq",
    )


def _distances(chain: Chain, collision: CollisionModel) -> Kernels:
    motion, plane_ = motion_of(chain, 1), Argument("plane", (4,), "1|m", shared=True)
    (q,), plane = motion.values(), plane_.symbol()

    def outputs(distance: Matrix, jacobian: Matrix) -> dict[Argument, Matrix]:
        slopes = Argument("jacobian", jacobian.shape, "d distance / d q")
        return {Argument("distance", (jacobian.shape[0],), "m"): distance, slopes: jacobian}

    kernels = []
    if collision.pairs:
        kernels.append(
            make_kernel(
                "clearance",
                motion,
                outputs(*clearance(chain, collision, q)),
                "distance of the capsules of each pair, negative where they overlap",
                unhurried=True,  # loops call its tiles
            )
        )
    if moving(chain, collision):
        kernels.append(
            make_rare(
                "plane_clearance",
                motion | {plane_: plane},
                outputs(*plane_clearance(chain, collision, q, plane)),
                "least n.x - d over each moving capsule, plane = (n, d) with a unit normal n",
            )
        )
    return tuple(kernels)


def proof_kernels(chain: Chain) -> Kernels:
    """Return the kernels of bounds over intervals; a batch runs over intervals."""
    if chain.loops is not None:
        return ()
    n, links, effort = len(chain.coordinates), len(chain.joints), effort_unit(chain)
    pi_ = Argument("pi", (N_PARAMETERS * links,), "SI", shared=True)
    pi = pi_.symbol()
    (six_, six), (four_, four), (two_, two) = (_interval(chain, k) for k in (6, 4, 2))
    torque = bounds.torque_bounds(chain, six[1], pi)
    speed, turn = bounds.speed_bounds(chain, two[1])
    return (
        make_rare(
            "torque_bounds",
            {six_: six[0], pi_: pi},
            {Argument("tau_sup", (4, n), f"({effort}, /s, /s^2, /s^3)"): torque},
            "sup |tau| and of its derivatives in time, from q_sup[k] = sup |d^k q / dt^k|",
        ),
        make_rare(
            "tip_bounds",
            {four_: four[0]},
            {Argument("p_sup", (4,), "(m, m/s, m/s^2, m/s^3)"): bounds.tip_bounds(chain, four[1])},
            "sup |p| of the tip and of its derivatives in time, from sup |d^k q / dt^k|",
        ),
        make_rare(
            "speed_bounds",
            {two_: two[0]},
            {
                Argument("origin", (links, links), "m/s"): speed,
                Argument("turn", (links,), "rad/s"): turn,
            },
            "sup of the speed of the origin of link i by joint j, and of the joint's turning",
        ),
    )


def _interval(chain: Chain, orders: int) -> tuple[Argument, tuple[Matrix, Matrix]]:
    """Bounds of q and its derivatives: argument, and its symbol with the matrix (orders, n)."""
    n = len(chain.coordinates)
    unit = ", ".join(state_unit(chain, k) for k in range(2))
    argument = Argument("q_sup", (orders, n), f"({unit}, ...)")
    symbol = argument.symbol()
    return argument, (symbol, ca.reshape(symbol, n, orders).T)


def trajectory_kernels(chain: Chain, base: BaseParameters, omitted: Container[str] = ()) -> Kernels:
    """Return the kernels that the design of a motion needs beside those of its limits."""
    n, b = len(chain.coordinates), len(base.columns)
    m_, t_ = Argument("m", (1,), "1"), Argument("t", (1,), "s")
    tf_ = Argument("t_f", (1,), "s", shared=True)
    m, t, tf = m_.symbol(), t_.symbol(), tf_.symbol()
    seed_ = Argument("seed", (n, b), "d cost / d Y_b")
    seed = seed_.symbol()
    bases = (
        make_rare(
            "harmonic_basis",
            {m_: m, t_: t, tf_: tf},
            {Argument("phi", (4,), "1, 1/s, 1/s^2, 1/s^3"): excitation.harmonic_basis(m, t, tf)},
            "cos(2 pi m s) - 1 + 2 pi^2 m^2 s^2 (1-s)^2, s = t/t_f, Eqs. 3.24-3.27",
            "point",
        ),
        make_rare(
            "transfer_basis",
            {t_: t, tf_: tf},
            {Argument("S", (4,), "1, 1/s, 1/s^2, 1/s^3"): excitation.transfer_basis(t, tf)},
            "10 s^3 - 15 s^4 + 6 s^5, s = t/t_f, Eqs. 3.25, 3.27",
            "point",
        ),
    )
    if "regressor_adjoint" in omitted:
        return bases
    motion = motion_of(chain, 3)
    q, dq, ddq = motion.values()
    gradient = excitation.regressor_adjoint(chain, q, dq, ddq, base.columns, seed)
    return (
        *bases,
        make_kernel(
            "regressor_adjoint",
            motion | {seed_: seed},
            {Argument("gradient", (3, n), "d cost / d (q, dq, ddq)"): gradient},
            "d <seed, Y_b> / d (q, dq, ddq), the adjoint of Eq. 3.29",
            unhurried=True,  # loops call its tiles
        ),
    )
