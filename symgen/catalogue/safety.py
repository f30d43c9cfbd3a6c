"""Kernels for the limits of a motion: torque and its rate, tip, distances, with derivatives.

Distance kernels exist only where a robot has proxies. A design spends its time in other kernels, so
most of these run sample by sample: vector code for them would double the build time.
"""

from collections.abc import Container
from typing import Any

import casadi as ca

from symgen.catalogue.units import STATE, effort_unit, state_unit
from symgen.chain import Chain
from symgen.collision import CollisionModel
from symgen.collision.distance import clearance, moving, plane_clearance
from symgen.kernel import Argument, Kernel, make_kernel
from symgen.mechanics import dynamics, kinematics
from symgen.mechanics.base_parameters import regrouped
from symgen.mechanics.inertia import N_PARAMETERS


def safety_kernels(
    chain: Chain, collision: CollisionModel, omitted: Container[str] = ()
) -> tuple[Kernel, ...]:
    """Return the kernels of all limits of a motion beyond those of q and its derivatives."""
    torques = () if "torque_rate" in omitted else _torques(chain)
    return (*torques, _tip(chain), *_distances(chain, collision))


def _motion(chain: Chain, count: int) -> tuple[list[Argument], list[Any]]:
    n = len(chain.coordinates)
    arguments = [Argument(STATE[k], (n,), state_unit(chain, k)) for k in range(count)]
    return arguments, [a.symbol() for a in arguments]


def _torques(chain: Chain) -> tuple[Kernel, ...]:
    n, links, effort = len(chain.coordinates), len(chain.joints), effort_unit(chain)
    arguments, symbols = _motion(chain, 5)
    q, dq, ddq, dddq, _ = symbols
    pi_ = Argument("pi", (N_PARAMETERS * links,), "SI", shared=True)
    pi = pi_.symbol()
    still = dict(zip(arguments[:3], symbols[:3], strict=True)) | {pi_: pi}
    moved = dict(zip(arguments[:4], symbols[:4], strict=True)) | {pi_: pi}
    bent = dict(zip(arguments, symbols, strict=True)) | {pi_: pi}
    tau = dynamics.inverse_dynamics(chain, q, dq, ddq, regrouped(chain, pi))
    rate = ca.jtimes(tau, ca.vertcat(q, dq, ddq), ca.vertcat(dq, ddq, dddq))
    bend = ca.jtimes(rate, ca.vertcat(*symbols[:4]), ca.vertcat(*symbols[1:]))
    names = ("dtau_dq", "dtau_dv", "dtau_da")
    together = ca.jacobian(tau, ca.vertcat(q, dq, ddq))  # shares its sweeps
    slopes = {
        Argument(name, (n, n), f"d tau / d {STATE[k]}"): together[:, k * n : (k + 1) * n]
        for k, name in enumerate(names)
    }
    seed_ = Argument("seed", (n,), "d cost / d tau_rate")
    seed = seed_.symbol()
    return (
        make_kernel(
            "torque_derivatives",
            still,
            {Argument("tau", (n,), effort): tau, **slopes},
            "tau of Eq. 4.3 and its derivatives by q, dq and ddq, the last one M(q)",
            rare=True,
        ),
        make_kernel(
            "torque_rate",
            moved,
            {Argument("tau_rate", (n,), f"({effort})/s"): rate},
            "d tau / d t = dtau_dq dq + dtau_dv ddq + dtau_da dddq",
            rare=True,
        ),
        make_kernel(
            "torque_rate_adjoint",
            moved | {seed_: seed},
            {
                Argument("gradient", (4, n), "d cost / d (q, dq, ddq, dddq)"): ca.reshape(
                    ca.jtimes(rate, ca.vertcat(*symbols[:4]), seed, True), n, 4
                ).T
            },
            "d (seed . d tau / d t) / d (q, dq, ddq, dddq)",
            rare=True,
            unhurried=True,
        ),
        make_kernel(
            "torque_course",
            bent,
            {
                Argument("tau", (n,), effort): tau,
                Argument("dtau", (n,), f"({effort})/s"): rate,
                Argument("ddtau", (n,), f"({effort})/s^2"): bend,
            },
            "tau of Eq. 4.3 and its two first derivatives in time along a motion",
            rare=True,
            unhurried=True,
        ),
    )


def _tip(chain: Chain) -> Kernel:
    n = len(chain.coordinates)
    arguments, (q, dq) = _motion(chain, 2)
    p = kinematics.end_effector(chain, q)[:3, 3]
    v = ca.jtimes(p, q, dq)
    return make_kernel(
        "tip_motion",
        dict(zip(arguments, (q, dq), strict=True)),
        {
            Argument("p", (3,), "m"): p,
            Argument("v", (3,), "m/s"): v,
            Argument("dp_dq", (3, n), "d p / d q"): ca.jacobian(p, q),
            Argument("dv_dq", (3, n), "d v / d q"): ca.jacobian(v, q),
        },
        "place and velocity v = dp_dq dq of the tip in the base frame; d v / d dq is dp_dq",
        rare=True,
    )


def _distances(chain: Chain, collision: CollisionModel) -> tuple[Kernel, ...]:
    n = len(chain.coordinates)
    (q_,), (q,) = _motion(chain, 1)
    plane_ = Argument("plane", (4,), "1|m", shared=True)
    plane = plane_.symbol()
    kernels = []
    if collision.pairs:
        distance, jacobian = clearance(chain, collision, q)
        count = len(collision.pairs)
        kernels.append(
            make_kernel(
                "clearance",
                {q_: q},
                {
                    Argument("distance", (count,), "m"): distance,
                    Argument("jacobian", (count, n), "d distance / d q"): jacobian,
                },
                "distance of the capsules of each pair, negative where they overlap",
                unhurried=True,  # loops call its tiles
            )
        )
    if moving(chain, collision):
        distance, jacobian = plane_clearance(chain, collision, q, plane)
        count = len(moving(chain, collision))
        kernels.append(
            make_kernel(
                "plane_clearance",
                {q_: q, plane_: plane},
                {
                    Argument("distance", (count,), "m"): distance,
                    Argument("jacobian", (count, n), "d distance / d q"): jacobian,
                },
                "least n.x - d over each moving capsule, plane = (n, d) with a unit normal n",
                rare=True,
            )
        )
    return tuple(kernels)
