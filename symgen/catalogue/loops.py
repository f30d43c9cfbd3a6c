"""Kernels of one body (λ ↔ π, log-Cholesky, pseudo-inertia with barrier), and of closed chains."""

from functools import partial

import casadi as ca

from symgen.catalogue.motion import motion_of, state_unit
from symgen.chain import Chain
from symgen.kernel import Argument, Kernels, Matrix, make_kernel, make_rare, make_slow, with_further
from symgen.mechanics import closure, inertia, kinematics, loop_equations
from symgen.mechanics.inertia import N_PARAMETERS as P
from symgen.mechanics.loop_equations import closed_chain

kernel, rare, slow = (partial(make, per="link") for make in (make_kernel, make_rare, make_slow))


def body_kernels() -> Kernels:
    """Return the kernels of one body; their batches run over links."""
    pi_, lam_ = Argument("pi", (P,), "SI"), Argument("lam", (P,), "lambda")
    frame_ = Argument("frame", (12,), "m, R by columns, B, C")
    floor_ = Argument("floor", (1,), "1", shared=True)
    slope_ = Argument("slope", (P,), "d cost / d pi")
    theta_ = Argument("theta", (P,), "log-Cholesky")
    arguments = (pi_, lam_, frame_, floor_, slope_, theta_)
    pi, lam, frame, floor, slope, theta = (a.symbol() for a in arguments)
    of_lam, of_theta = inertia.pi_from_lam(lam), inertia.pi_from_cholesky(theta)
    pivot, log_det, traces, curvature = inertia.barrier(pi)
    return (
        kernel("pi_from_lam", {lam_: lam}, {pi_: of_lam}, "Eqs. 4.25-4.31"),
        kernel(
            "pi_jacobian",
            {lam_: lam},
            {pi_: of_lam, Argument("jacobian", (P, P), "d pi / d lam"): ca.jacobian(of_lam, lam)},
            "pi and d pi / d lam of one link",
        ),
        kernel(
            "pi_frame",
            {lam_: lam},
            {pi_: of_lam, frame_: inertia.lam_frame(lam)},
            "pi of one link, and its m, R, B, C for pi_adjoint",
        ),
        kernel(
            "pi_adjoint",
            {lam_: lam, frame_: frame, slope_: slope},
            {Argument("gradient", (P,), "d cost / d lam"): inertia.pi_adjoint(lam, frame, slope)},
            "(d pi / d lam)' slope of one link, Eq. 4.32",
        ),
        kernel(
            "cholesky_jacobian",
            {theta_: theta},
            {
                pi_: of_theta,
                Argument("jacobian", (P, P), "d pi / d theta"): ca.jacobian(of_theta, theta),
            },
            "pi and d pi / d theta of one link, P = U(theta) U(theta)'",
        ),
        kernel(
            "barrier",
            {pi_: pi},
            {
                Argument("pivot", (1,), "SI"): pivot,
                Argument("log_det", (1,), "1"): log_det,
                Argument("traces", (P,), "1/SI"): traces,
                Argument("curvature", (P, P), "1/SI^2"): curvature,
            },
            "smallest pivot and log det of P, tr(P^-1 B_i), tr(P^-1 B_i P^-1 B_j), B_i = dP/dpi_i",
        ),
        slow(
            "cholesky_from_pi",
            {pi_: pi},
            {theta_: inertia.cholesky_from_pi(pi)},
            "theta with U(theta) U(theta)' = P; NaN unless P is positive definite",
        ),
        slow("lam_from_pi", {pi_: pi}, {lam_: inertia.lam_from_pi(pi)}, "Eqs. 4.18-4.23"),
        slow(
            "nearest_realisable",
            {pi_: pi, floor_: floor},
            {Argument("realisable", (P,), "SI"): inertia.nearest_realisable(pi, floor)},
            "pi with the eigenvalues of Sigma_com raised to floor * trace + m (1 mm)^2",
        ),
        rare(
            "inertia_matrix",
            {lam_: lam},
            {Argument("M", (6, 6), "SI"): inertia.spatial_inertia(lam)},
            "M(lam), Eq. 4.14 (linear part first)",
        ),
        rare(
            "pseudo_inertia",
            {pi_: pi},
            {Argument("P", (4, 4), "SI"): inertia.pseudo_inertia(pi)},
            "P(pi), Eqs. 3.9, 3.10",
        ),
    )


def loop_kernels(chain: Chain) -> Kernels:
    """Return the kernels that lead from the independent joints to all."""
    if chain.loops is None:
        return ()
    n, count, motion = len(chain.coordinates), len(chain.joints), motion_of(chain, 3)
    (q_, *_), (q, dq, ddq) = motion, motion.values()
    last_ = Argument("last", (count,), state_unit(chain, 0))
    last = last_.symbol()
    _, margin = loop_equations.seed_values(closed_chain(chain), q)
    d = _dependent(chain, last)
    after, after_margin = loop_equations.values_from_last(closed_chain(chain), q, d)
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


def without_seeds(chain: Chain, kernels: Kernels) -> Kernels:
    """The kernels with the values of the loops' seeds."""

    def values(inputs: dict[str, Matrix], further: Matrix) -> Matrix:
        return closure.values_of(chain, inputs["q"], ca.vertsplit(further))

    return tuple(with_further(kernel, values) for kernel in kernels)


def _dependent(chain: Chain, everything: Matrix) -> Matrix:
    """d of all positions."""
    loops = closed_chain(chain).loops
    free = range(len(chain.joints)) if chain.coupling is None else chain.coupling.independent
    return everything[[list(free)[k] for k in loops.dependent]]
