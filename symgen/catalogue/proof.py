"""Kernels that bound torques, tip and links on an interval of time, for proofs between samples."""

import casadi as ca

from symgen.catalogue.units import effort_unit, state_unit
from symgen.chain import Chain
from symgen.kernel import Argument, Kernel, Matrix, make_kernel
from symgen.mechanics import derivative_bounds as bounds
from symgen.mechanics.inertia import N_PARAMETERS


def proof_kernels(chain: Chain) -> tuple[Kernel, ...]:
    """Return the kernels of bounds over intervals; a batch runs over intervals."""
    if chain.loops is not None:
        return ()
    n, links, effort = len(chain.coordinates), len(chain.joints), effort_unit(chain)
    pi_ = Argument("pi", (N_PARAMETERS * links,), "SI", shared=True)
    pi = pi_.symbol()
    (six_, six), (four_, four), (two_, two) = (_motion(chain, k) for k in (6, 4, 2))
    speed, turn = bounds.speed_bounds(chain, two[1])
    return (
        make_kernel(
            "torque_bounds",
            {six_: six[0], pi_: pi},
            {
                Argument("tau_sup", (4, n), f"({effort}, /s, /s^2, /s^3)"): bounds.torque_bounds(
                    chain, six[1], pi
                )
            },
            "sup |tau| and of its derivatives in time, from q_sup[k] = sup |d^k q / dt^k|",
            rare=True,
        ),
        make_kernel(
            "tip_bounds",
            {four_: four[0]},
            {Argument("p_sup", (4,), "(m, m/s, m/s^2, m/s^3)"): bounds.tip_bounds(chain, four[1])},
            "sup |p| of the tip and of its derivatives in time, from sup |d^k q / dt^k|",
            rare=True,
        ),
        make_kernel(
            "speed_bounds",
            {two_: two[0]},
            {
                Argument("origin", (links, links), "m/s"): speed,
                Argument("turn", (links,), "rad/s"): turn,
            },
            "sup of the speed of the origin of link i by joint j, and of the joint's turning",
            rare=True,
        ),
    )


def _motion(chain: Chain, orders: int) -> tuple[Argument, tuple[Matrix, Matrix]]:
    """Bounds of q and its derivatives: argument, and its symbol with the matrix (orders, n)."""
    n = len(chain.coordinates)
    unit = ", ".join(state_unit(chain, k) for k in range(2))
    argument = Argument("q_sup", (orders, n), f"({unit}, ...)")
    symbol = argument.symbol()
    return argument, (symbol, ca.reshape(symbol, n, orders).T)
