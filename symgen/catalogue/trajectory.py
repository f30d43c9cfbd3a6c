"""Kernels for the design of a motion: bases of trajectories and the adjoint of the regressor."""

from collections.abc import Container

import casadi as ca

from symgen.catalogue.units import STATE, state_unit
from symgen.chain import Chain
from symgen.kernel import Argument, Kernel, make_kernel
from symgen.mechanics import excitation
from symgen.mechanics.base_parameters import BaseParameters


def trajectory_kernels(
    chain: Chain, base: BaseParameters, omitted: Container[str] = ()
) -> tuple[Kernel, ...]:
    """Return the kernels that the design of a motion needs beside those of its limits."""
    n, b = len(chain.coordinates), len(base.columns)
    m_, t_, tf_ = (
        Argument("m", (1,), "1"),
        Argument("t", (1,), "s"),
        Argument("t_f", (1,), "s", shared=True),
    )
    m, t, tf = m_.symbol(), t_.symbol(), tf_.symbol()
    motion = {
        Argument(STATE[k], (n,), state_unit(chain, k)): ca.SX.sym(STATE[k], n) for k in range(3)
    }
    q, dq, ddq = motion.values()
    seed_ = Argument("seed", (n, b), "d cost / d Y_b")
    seed = seed_.symbol()
    bases = (
        make_kernel(
            "harmonic_basis",
            {m_: m, t_: t, tf_: tf},
            {Argument("phi", (4,), "1, 1/s, 1/s^2, 1/s^3"): excitation.harmonic_basis(m, t, tf)},
            "cos(2 pi m s) - 1 + 2 pi^2 m^2 s^2 (1-s)^2, s = t/t_f, Eqs. 3.24-3.27",
            "point",
            rare=True,
        ),
        make_kernel(
            "transfer_basis",
            {t_: t, tf_: tf},
            {Argument("S", (4,), "1, 1/s, 1/s^2, 1/s^3"): excitation.transfer_basis(t, tf)},
            "10 s^3 - 15 s^4 + 6 s^5, s = t/t_f, Eqs. 3.25, 3.27",
            "point",
            rare=True,
        ),
    )
    if "regressor_adjoint" in omitted:
        return bases
    return (
        *bases,
        make_kernel(
            "regressor_adjoint",
            motion | {seed_: seed},
            {
                Argument("gradient", (3, n), "d cost / d (q, dq, ddq)"): (
                    excitation.regressor_adjoint(chain, q, dq, ddq, base.columns, seed)
                )
            },
            "d <seed, Y_b> / d (q, dq, ddq), the adjoint of Eq. 3.29",
            unhurried=True,  # loops call its tiles
        ),
    )
