"""Kernels of closed chains: motion of all joints, Jacobian, margins of the loops."""

import casadi as ca

from symgen.catalogue.motion import motion_of, state_unit
from symgen.chain import Chain
from symgen.kernel import Argument, Kernel, Matrix, make_rare, with_further
from symgen.mechanics import closure, kinematics, loop_equations
from symgen.mechanics.loop_equations import closed_chain


def loop_kernels(chain: Chain) -> tuple[Kernel, ...]:
    """Return the kernels that lead from the independent joints to all."""
    if chain.loops is None:
        return ()
    n, count, motion = len(chain.coordinates), len(chain.joints), motion_of(chain, 3)
    (q_, *_), (q, dq, ddq) = motion, motion.values()
    last_ = Argument("last", (count,), state_unit(chain, 0))
    last = last_.symbol()
    _, margin = loop_equations.seed_values(closed_chain(chain), q)
    after, after_margin = loop_equations.values_from_last(
        closed_chain(chain), q, _dependent(chain, last)
    )
    everything = kinematics.all_positions(chain, q)
    rates = kinematics.all_rates(chain, q, dq)
    accelerations = kinematics.all_accelerations(chain, q, dq, ddq)
    jacobian = ca.densify(kinematics.joint_jacobian(chain, q))
    continued = closure.with_seeds(chain, everything, after)
    blocks = len(chain.loops.blocks)
    return (
        make_rare(
            "all_joints",
            motion,
            {
                Argument("q_all", (count,), state_unit(chain, 0)): everything,
                Argument("dq_all", (count,), state_unit(chain, 1)): rates,
                Argument("ddq_all", (count,), state_unit(chain, 2)): accelerations,
            },
            "phi(q, d) = 0 by Newton from the assembly pose; NaN at singular postures",
        ),
        make_rare(
            "joint_jacobian",
            {q_: q},
            {
                Argument("G", (count, n), "d q_all / d q"): jacobian,
                Argument("margin", (blocks,), "1"): margin,
            },
            "G = d q_all / d q; margin of each loop, 1 at the assembly, 0 where it is singular",
        ),
        make_rare(
            "next_positions",
            {q_: q, last_: last},
            {
                Argument("q_all", (count,), state_unit(chain, 0)): continued,
                Argument("margin", (blocks,), "1"): after_margin,
            },
            "phi(q, d) = 0 by Newton from all positions of a sample shortly before",
        ),
    )


def without_seeds(chain: Chain, kernels: tuple[Kernel, ...]) -> tuple[Kernel, ...]:
    """The kernels with the values of the loops' seeds."""

    def values(inputs: dict[str, Matrix], further: Matrix) -> Matrix:
        return closure.values_of(chain, inputs["q"], ca.vertsplit(further))

    return tuple(with_further(kernel, values) for kernel in kernels)


def _dependent(chain: Chain, everything: Matrix) -> Matrix:
    """d of all positions."""
    loops = closed_chain(chain).loops
    free = range(len(chain.joints)) if chain.coupling is None else chain.coupling.independent
    return everything[[list(free)[k] for k in loops.dependent]]
