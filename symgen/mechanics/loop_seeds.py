"""Newton on symbols: dependent positions d = g(q) and φ_d⁻¹, with a fixed number of steps.

From the assembly pose along a straight line to q, or from the positions of the last sample. Joints
that turn without end take the line to q less whole turns; dependent joints that turn with them, a
whole number of times per turn, follow:  d(q + 2π e_i) = d(q) + 2π w_i. A pose
that does not close, or whose margin has fallen on the way, gives NaN: its branch would be unknown.
The code is not differentiated, see `closure`.
"""

from functools import lru_cache

import casadi as ca

from symgen.kernel import Matrix
from symgen.mechanics.givens import Triangle, triangle
from symgen.mechanics.loop_equations import ClosedChain, equations, joined, slopes

STEPS = 10
"""Steps from the assembly pose to q; the next step is predicted by the last two."""
POLISH = 3
"""Iterations of Newton at q: they double the digits, and the last step leaves about two."""
CLOSED = 1e-9
"""Largest |φ| of a closed pose, m or rad."""
SINGULAR = 1e-3
"""Share of the assembly pose's margin below which a posture counts as singular."""


def seed_values(chain: ClosedChain, q: Matrix) -> tuple[Matrix, Matrix]:
    """Values of the seeds, NaN where a loop cannot close or is singular, and the margins.

    q (n,) [rad, m].
    """
    values, margins = _continued(chain)(q)
    return values, margins


@lru_cache(maxsize=8)
def _continued(chain: ClosedChain) -> ca.Function:
    """Seeds and margins as a function of q."""
    loops = chain.loops
    q = ca.SX.sym("q", len(loops.independent))
    near = _within_a_turn(chain, q)
    x0 = ca.DM(loops.assembly)
    q0, d = x0[list(loops.independent)], ca.SX(x0[list(loops.dependent)])
    before, least = None, None
    for k in range(1, STEPS + 1):
        here = q0 + k / STEPS * (near - q0)
        start = d if before is None else 2 * d - before
        before = d
        d, margin = _newton(chain, here, start)
        least = margin if least is None else ca.fmin(least, margin)
    for turn in loops.turns:
        d = d + ca.DM(turn.windings) * (q[turn.place] - near[turn.place])
    return ca.Function("seeds", [q], list(_polished(chain, q, d, least, POLISH)))


def _within_a_turn(chain: ClosedChain, q: Matrix) -> Matrix:
    """Positions less whole turns of the joints that turn without end, half a turn from assembly."""
    loops = chain.loops
    near = q[:]
    for turn in loops.turns:
        start = loops.assembly[loops.independent[turn.place]]
        away = q[turn.place] - start
        near[turn.place] = start + ca.atan2(ca.sin(away), ca.cos(away))
    return near


def values_from_last(chain: ClosedChain, q: Matrix, d: Matrix) -> tuple[Matrix, Matrix]:
    """`seed_values` from the dependent positions of a sample shortly before.

    q (n,) [rad, m], d (r,) [rad, m].
    """
    loops = chain.loops
    return _polished(chain, q, d, ca.SX(ca.DM.ones(len(loops.blocks))), POLISH)


def _newton(chain: ClosedChain, q: Matrix, d: Matrix) -> tuple[Matrix, Matrix]:
    """One step of Newton from d at q, and the margins at d."""
    systems = _systems(chain, q, d)
    return d - _stacked(chain, [s.solution() for s in systems]), _margins(chain, systems)


def _systems(chain: ClosedChain, q: Matrix, d: Matrix, inverse: bool = False) -> list[Triangle]:
    """φ_d y = φ of each block after elimination, or φ_d [y, W] = [φ, 1]."""
    loops = chain.loops
    x = joined(chain, q, d)
    phi, slope = equations(chain)(x), slopes(chain)(x)[:, list(loops.dependent)]
    systems = []
    for rows, columns in loops.blocks:
        right: Matrix = phi[list(rows)]
        if inverse:
            right = ca.horzcat(right, ca.SX(ca.DM.eye(len(rows))))
        systems.append(triangle(slope[list(rows), list(columns)], right))
    return systems


def _stacked(chain: ClosedChain, parts: list[Matrix]) -> Matrix:
    """Columns of the blocks as one vector in the order of d."""
    loops = chain.loops
    whole = ca.SX(len(loops.dependent), 1)
    for part, (_, columns) in zip(parts, loops.blocks, strict=True):
        for k, place in enumerate(columns):
            whole[place] = part[k, 0]
    return whole


def _margins(chain: ClosedChain, systems: list[Triangle]) -> Matrix:
    return ca.vertcat(*(system.margin for system in systems)) / _assembled(chain)


@lru_cache(maxsize=8)
def _assembled(chain: ClosedChain) -> Matrix:
    """Margins of the assembly pose, numbers with a sign."""
    loops = chain.loops
    x0 = ca.SX(ca.DM(loops.assembly))
    systems = _systems(chain, x0[list(loops.independent)], x0[list(loops.dependent)])
    return ca.evalf(ca.vertcat(*(system.margin for system in systems)))


def _polished(
    chain: ClosedChain, q: Matrix, d: Matrix, least: Matrix, count: int
) -> tuple[Matrix, Matrix]:
    """Newton at q; values of the seeds and margins, NaN where refused."""
    for _ in range(count):
        d, _ = _newton(chain, q, d)
    systems = _systems(chain, q, d, inverse=True)
    solutions = [system.solution() for system in systems]
    margin = _margins(chain, systems)
    apart = ca.fabs(equations(chain)(joined(chain, q, d)))  # before the last step
    closed: Matrix = ca.SX(1)
    for value in ca.vertsplit(apart):
        closed = closed * (value < CLOSED)
    for value in ca.vertsplit(ca.fmin(least, margin)):
        closed = closed * (value > SINGULAR)
    refused = ca.sqrt(closed - 1)  # 0, or NaN: the root of −1
    inverses = [ca.vec(solution[:, 1:]) for solution in solutions]
    return ca.vertcat(d - _stacked(chain, solutions) + refused, *inverses), margin + refused
