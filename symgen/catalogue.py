"""The kernels that every robot ships: each one line of algebra and one sentence.

Batches run over samples, over links (maps of one body) or over points of a time grid.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from symgen import dynamics, excitation, inertia
from symgen.base_parameters import Array, BaseParameters, numeric_base
from symgen.chain import Chain
from symgen.kernel import Argument, Kernel, make_kernel

P = inertia.N_PARAMETERS


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All kernels of one robot and the base parameters that shaped some of them."""

    kernels: tuple[Kernel, ...]
    base: BaseParameters


def make_catalogue(chain: Chain) -> Catalogue:
    """Write every kernel of a chain."""
    base = numeric_base(chain, dynamics.sampled_regressor(chain))
    return Catalogue((*_motion(chain, base), *_bodies(), *_excitation(chain, base)), base)


def _units(chain: Chain, power: int) -> str:
    """Unit of q (0), dq (1), ddq (2) for all joints together."""
    kinds = {"m" if j.kind == "prismatic" else "rad" for j in chain.joints}
    return "|".join(sorted(kinds)) + ("", "/s", "/s^2")[power]


def _motion(chain: Chain, base: BaseParameters) -> tuple[Kernel, ...]:
    n, b = len(chain.joints), len(base.columns)
    slides = {j.kind == "prismatic" for j in chain.joints}
    effort = "|".join({True: "N", False: "N*m"}[s] for s in sorted(slides))
    q_, dq_, ddq_ = (Argument(name, (n,), _units(chain, k)) for k, name in enumerate(_STATE))
    tau_, pi_ = Argument("tau", (n,), effort), Argument("pi", (P * n,), "SI", shared=True)
    beta_ = Argument("beta", (b,), "SI", shared=True)
    lam_ = Argument("lam", (P * n,), "lambda", shared=True)
    weight_ = Argument("weight", (n,), "1", shared=True)
    inertia_unit = "|".join({True: "kg", False: "kg*m^2"}[s] for s in sorted(slides))
    rotor_ = Argument("rotor", (n,), inertia_unit, shared=True)
    s = {a: a.symbol() for a in (q_, dq_, ddq_, tau_, pi_, beta_, lam_, weight_, rotor_)}
    q, dq, ddq, tau, pi, beta, lam, weight, rotor = s.values()
    motion = {a: s[a] for a in (q_, dq_, ddq_)}
    with_pi, with_lam = motion | {pi_: pi}, motion | {lam_: lam}
    predicted = dynamics.inverse_dynamics(chain, q, dq, ddq, pi)
    from_base = dynamics.inverse_dynamics(chain, q, dq, ddq, _expanded(base, beta))
    torque = ca.substitute(from_base, beta, _times(base.matrix, dynamics.pi_from_lam_all(lam)))
    pi_own_, beta_own_ = Argument("pi", (P * n,), "SI"), Argument("beta", (b,), "SI")
    slope_ = Argument("slope", (b,), "d cost / d beta")
    pi_own, slope_of_beta = pi_own_.symbol(), slope_.symbol()
    residual = from_base - tau
    loss = ca.dot(residual, weight * residual) / 2
    slope = ca.jtimes(from_base, beta, weight * residual, True)
    return (
        make_kernel(
            "inverse_dynamics", with_pi, {tau_: predicted}, "tau = Y(q, dq, ddq) pi, Eq. 4.3"
        ),
        make_kernel(
            "base_inverse_dynamics",
            motion | {beta_: beta},
            {tau_: from_base},
            "tau = Y_b(q, dq, ddq) beta, Eq. 3.11",
        ),
        make_kernel("torque", with_lam, {tau_: torque}, "tau = Y(q, dq, ddq) pi(lam), Eq. 4.3"),
        make_kernel(
            "torque_jacobian",
            with_lam,
            {
                Argument("jacobian", (n, P * n), "d tau / d lam"): dynamics.torque_jacobian(
                    chain, q, dq, ddq, lam
                )
            },
            "d tau / d lam, Eqs. 4.34-4.36",
        ),
        make_kernel(
            "regressor",
            motion,
            {Argument("Y", (n, P * n), "d tau / d pi"): dynamics.regressor(chain, q, dq, ddq)},
            "Y with tau = Y pi, Eq. 3.1",
        ),
        make_kernel(
            "base_regressor",
            motion,
            {
                Argument("Y_b", (n, b), "d tau / d beta"): dynamics.regressor(
                    chain, q, dq, ddq, base.columns
                )
            },
            "Y_b with tau = Y_b beta, Eq. 3.11",
        ),
        make_kernel(
            "base_parameters",
            {pi_own_: pi_own},
            {beta_own_: _times(base.matrix, pi_own)},
            "beta = K pi, Eq. 3.11",
        ),
        make_kernel(
            "base_adjoint",
            {slope_: slope_of_beta},
            {Argument("gradient", (P * n,), "d cost / d pi"): _times(base.matrix.T, slope_of_beta)},
            "K' slope, the adjoint of beta = K pi",
        ),
        make_kernel(
            "mass_matrix",
            {q_: q, pi_: pi},
            {Argument("M", (n, n), "d tau / d ddq"): dynamics.mass_matrix(chain, q, pi)},
            "M(q), Eq. 2.34",
        ),
        make_kernel(
            "bias_forces",
            {q_: q, dq_: dq, pi_: pi},
            {Argument("h", (n,), effort): dynamics.bias_forces(chain, q, dq, pi)},
            "h = C(q, dq) dq - tau_grav, Eq. 2.34",
        ),
        make_kernel(
            "forward_dynamics",
            {q_: q, dq_: dq, tau_: tau, pi_: pi, rotor_: rotor},
            {ddq_: dynamics.forward_dynamics(chain, q, dq, tau, pi, rotor)},
            "ddq = (M + diag(J))^-1 (tau - h), J of the rotors",
        ),
        make_kernel(
            "end_effector",
            {q_: q},
            {Argument("H", (4, 4), "1|m"): dynamics.end_effector(chain, q)},
            "pose of the tip in the base frame, Eq. 2.15",
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
        ),
    )


def _expanded(base: BaseParameters, beta: Any) -> Any:
    """A π with these base parameters: β in the base columns, zero elsewhere."""
    pi = ca.SX(base.matrix.shape[1], 1)
    for k, column in enumerate(base.columns):
        pi[column] = beta[k]
    return pi


def _times(matrix: Array, vector: Any) -> Any:
    """matrix · vector without the zeros of the matrix."""
    return ca.mtimes(ca.sparsify(ca.DM(matrix)), vector)


def _bodies() -> tuple[Kernel, ...]:
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


def _excitation(chain: Chain, base: BaseParameters) -> tuple[Kernel, ...]:
    n, b = len(chain.joints), len(base.columns)
    m_, t_, tf_ = (
        Argument("m", (1,), "1"),
        Argument("t", (1,), "s"),
        Argument("t_f", (1,), "s", shared=True),
    )
    m, t, tf = m_.symbol(), t_.symbol(), tf_.symbol()
    motion = {
        Argument(name, (n,), _units(chain, k)): ca.SX.sym(name, n) for k, name in enumerate(_STATE)
    }
    q, dq, ddq = motion.values()
    seed_ = Argument("seed", (n, b), "d cost / d Y_b")
    seed = seed_.symbol()
    return (
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
        make_kernel(
            "regressor_adjoint",
            motion | {seed_: seed},
            {
                Argument("gradient", (3, n), "d cost / d (q, dq, ddq)"): (
                    excitation.regressor_adjoint(chain, q, dq, ddq, base.columns, seed)
                )
            },
            "d <seed, Y_b> / d (q, dq, ddq), the adjoint of Eq. 3.29",
        ),
    )


_STATE = ("q", "dq", "ddq")
