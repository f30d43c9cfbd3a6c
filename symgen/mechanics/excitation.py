"""Excitation trajectories: the Fourier + quintic basis and the adjoint of the regressor.

q(t) = q0 + (q1 − q0) S(s) + Σ_m a_m φ_m(s), s = t/t_f, with the boundary quintic of Eqs. 3.24–3.27
folded into the basis: S = 10s³ − 15s⁴ + 6s⁵ moves the joint from q0 to q1 at rest, and
φ_m = cos 2πms − 1 + 2π²m² s²(1−s)² vanishes at both ends with two derivatives.
A criterion J(Σ YᵀY) has the exact gradient Σ_k (∂q_k/∂θ)ᵀ ∂⟨S_k, Y_b⟩/∂q_k: code is generated for
one sample and its adjoint, never for the whole trajectory.
"""

import math

import casadi as ca

from symgen.chain import Chain
from symgen.kernel import Matrix
from symgen.mechanics.dynamics import regressor


def _with_derivatives(value: Matrix, t: Matrix) -> Matrix:
    rows = [value]
    for _ in range(3):
        rows.append(ca.jacobian(rows[-1], t))
    return ca.vertcat(*rows)


def harmonic_basis(m: Matrix, t: Matrix, t_f: Matrix) -> Matrix:
    """φ_m(t/t_f) and its first three time derivatives, (4,) [1, 1/s, 1/s², 1/s³]."""
    s = t / t_f
    value = ca.cos(2 * math.pi * m * s) - 1 + 2 * math.pi**2 * m**2 * s**2 * (1 - s) ** 2
    return _with_derivatives(value, t)


def transfer_basis(t: Matrix, t_f: Matrix) -> Matrix:
    """S(t/t_f) and its first three time derivatives, (4,) [1, 1/s, 1/s², 1/s³]."""
    s = t / t_f
    return _with_derivatives(s**3 * (10 - 15 * s + 6 * s**2), t)


def regressor_adjoint(
    chain: Chain, q: Matrix, dq: Matrix, ddq: Matrix, columns: tuple[int, ...], seed: Matrix
) -> Matrix:
    """∂⟨S, Y_b⟩/∂(q, dq, ddq), (3, n), of a seed S (n·n_b,)."""
    y = ca.densify(ca.vec(regressor(chain, q, dq, ddq, columns).T))
    return ca.horzcat(*(ca.jtimes(y, x, seed, True) for x in (q, dq, ddq))).T
