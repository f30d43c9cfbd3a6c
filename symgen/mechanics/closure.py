"""Closed chains: φ(q, d) = 0 as functions of the independent coordinates q.

    d = g(q),   ḋ = −φ_d⁻¹ φ_q dq,   d̈ = −φ_d⁻¹ (φ_q ddq + γ),   γ = d²φ/dt² for ddq = d̈ = 0
    Gᵀ f = f_q − φ_qᵀ φ_d⁻ᵀ f_d

Kernels are written in d and W = φ_d⁻¹ as further symbols, the seeds. Two steps d − W φ(q, d) and
two refinements y + W (b − φ_d y) of each solution lead from them to the coordinates. Where the
seeds are exact, these change nothing, and they make derivatives by q right up to the second, by the
implicit function theorem. The values of the seeds come from `loop_equations`.
"""

import re
from functools import lru_cache

import casadi as ca

from symgen.chain import Chain
from symgen.errors import BuildError
from symgen.kernel import Matrix
from symgen.mechanics.loop_equations import (
    ClosedChain,
    bends,
    closed_chain,
    equations,
    joined,
    seed_values,
    slopes,
)

_REFINED = 2  # order of derivatives by q that are exact


def positions(chain: Chain, q: Matrix) -> Matrix:
    """x = (q, g(q)) in the order of the chain, (n + r,) [rad, m]."""
    return _positions(closed_chain(chain), q)


def _positions(chain: ClosedChain, q: Matrix) -> Matrix:
    d, w = _split(chain, _seeds(_count(chain)))
    phi = equations(chain)
    for _ in range(_REFINED):
        d = d - _times(chain, w, phi(joined(chain, q, d)))
    return joined(chain, q, d)


def rates(chain: Chain, q: Matrix, dq: Matrix) -> Matrix:
    """ẋ = G dq, (n + r,) [rad/s, m/s]."""
    closed = closed_chain(chain)
    right = -_directional(closed, _positions(closed, q), joined(closed, dq, None))
    return joined(closed, dq, _solved(closed, q, right))


def accelerations(chain: Chain, q: Matrix, dq: Matrix, ddq: Matrix) -> Matrix:
    """ẍ = G ddq + Ġ dq, (n + r,) [rad/s², m/s²]."""
    closed = closed_chain(chain)
    x = _positions(closed, q)
    right = -_directional(closed, x, joined(closed, ddq, None))
    if dq.nnz():
        right = right - bends(closed)(x, rates(chain, q, dq))
    return joined(closed, ddq, _solved(closed, q, right))


def forces(chain: Chain, q: Matrix, force: Matrix) -> Matrix:
    """Gᵀ f, (n + r, m) → (n, m) [N·m, N]: generalised forces by virtual power."""
    closed = closed_chain(chain)
    slope = slopes(closed)(_positions(closed, q))
    passed = _solved(closed, q, force[list(closed.loops.dependent), :], transposed=True)
    direct = force[list(closed.loops.independent), :]
    return direct - ca.mtimes(slope[:, list(closed.loops.independent)].T, passed)


def jacobian(chain: Chain, q: Matrix) -> Matrix:
    """G = ∂x/∂q, (n + r, n)."""
    closed = closed_chain(chain)
    slope = slopes(closed)(_positions(closed, q))
    below = _solved(closed, q, -slope[:, list(closed.loops.independent)])
    return joined(closed, ca.SX(ca.DM.eye(len(closed.loops.independent))), below)


def supplied(chain: Chain, expression: Matrix, q: Matrix) -> Matrix:
    """The expression with the values of the seeds at q in their places."""
    if chain.loops is None:
        return expression
    return with_seeds(chain, expression, seed_values(closed_chain(chain), q)[0])


def with_seeds(chain: Chain, expression: Matrix, values: Matrix) -> Matrix:
    """The expression with these values of the seeds."""
    return ca.substitute(expression, _seeds(_count(closed_chain(chain))), values)


def values_of(chain: Chain, q: Matrix, further: list[Matrix]) -> Matrix:
    """Values at q of some of the seeds, (m,)."""
    places = []
    for symbol in further:
        match = re.fullmatch(rf"{_SEED}_(\d+)", symbol.name())
        if match is None or chain.loops is None:
            raise BuildError(f"a kernel depends on the symbol {symbol.name()}, which is no input")
        places.append(int(match[1]))
    return seed_values(closed_chain(chain), q)[0][places]


_SEED = "seed_of_loops"


@lru_cache(maxsize=64)
def _seeds(count: int) -> Matrix:
    return ca.SX.sym(_SEED, count)


def _count(chain: ClosedChain) -> int:
    """Dependent coordinates and entries of the inverses."""
    return len(chain.loops.dependent) + sum(len(rows) ** 2 for rows, _ in chain.loops.blocks)


def _split(chain: ClosedChain, seeds: Matrix) -> tuple[Matrix, list[Matrix]]:
    """d, and W of each block."""
    at = len(chain.loops.dependent)
    d, inverses = seeds[:at], []
    for rows, _ in chain.loops.blocks:
        r = len(rows)
        inverses.append(ca.reshape(seeds[at : at + r * r], r, r))
        at += r * r
    return d, inverses


def _times(
    chain: ClosedChain, inverses: list[Matrix], right: Matrix, transposed: bool = False
) -> Matrix:
    """W b, block by block."""
    result = ca.SX(*right.shape)
    for w, (rows, columns) in zip(inverses, chain.loops.blocks, strict=True):
        matrix, into, out = (w.T, columns, rows) if transposed else (w, rows, columns)
        part = ca.mtimes(matrix, right[list(into), :])
        for k, place in enumerate(out):
            result[place, :] = part[k, :]
    return result


def _solved(chain: ClosedChain, q: Matrix, right: Matrix, transposed: bool = False) -> Matrix:
    """φ_d⁻¹ b or φ_d⁻ᵀ b: W b and its refinements y + W (b − φ_d y)."""
    slope = slopes(chain)(_positions(chain, q))[:, list(chain.loops.dependent)]
    matrix = slope.T if transposed else slope
    _, inverses = _split(chain, _seeds(_count(chain)))
    y = _times(chain, inverses, right, transposed)
    for _ in range(_REFINED):
        y = y + _times(chain, inverses, right - ca.mtimes(matrix, y), transposed)
    return y


def _directional(chain: ClosedChain, x: Matrix, u: Matrix) -> Matrix:
    """∂φ/∂x u."""
    return ca.mtimes(slopes(chain)(x), u)
