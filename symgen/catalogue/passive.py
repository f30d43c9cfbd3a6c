"""Kernels of springs and torque curves; they exist only where a mechanism has any."""

from symgen.catalogue.units import STATE, effort_unit, state_unit
from symgen.chain import Chain
from symgen.kernel import Argument, Kernel, make_kernel
from symgen.mechanics import passive


def passive_kernels(chain: Chain) -> tuple[Kernel, ...]:
    """Return the kernels of torques that depend on q alone."""
    n, kernels = len(chain.coordinates), []
    q_ = Argument(STATE[0], (n,), state_unit(chain, 0))
    q = q_.symbol()
    springs = passive.unknown_springs(chain)
    if springs:
        kernels.append(
            make_kernel(
                "spring_columns",
                {q_: q},
                {Argument("S", (n, len(springs)), "d tau / d k"): passive.spring_columns(chain, q)},
                "tau = S k of the springs, S = (x - rest) dx / dq",
                rare=True,
            )
        )
    if len(springs) < len(chain.mechanism.spring) or chain.mechanism.known_torque:
        kernels.append(
            make_kernel(
                "known_torque",
                {q_: q},
                {Argument("tau", (n,), effort_unit(chain)): passive.known_torque(chain, q)},
                "tau = p(x) dx / dq of torque curves and of springs of known stiffness",
                rare=True,
            )
        )
    return tuple(kernels)
