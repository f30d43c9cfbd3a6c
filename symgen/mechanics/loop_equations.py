"""φ(x) = 0 of closed chains on symbols, and its solution d = g(q) by Newton with fixed steps.

φ are rows of the poses of the loop joints' frames. Newton goes from the assembly pose along a
straight line to q, or from the positions of the last sample. Joints that turn without end take the
line to q less whole turns; dependent joints follow:  d(q + 2π e_i) = d(q) + 2π w_i. A pose that
does not close, or whose margin has fallen on the way, gives NaN: its branch would be unknown.

Its linear systems are solved by rotations of rows, without pivots and branches: Q A = U, an upper
triangle of positive diagonal but for its last entry, which has the sign of det A. Source: Golub &
Van Loan, Matrix Computations, 4th ed., Sec. 5.2.5. At a pair of zeros the rotation has no
derivative, so the code is not differentiated, see `closure`.
"""

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from symgen.chain import Chain, Joint
from symgen.chain.coupling import Coupling
from symgen.chain.mechanism import FREE_ROWS, IN_SHARED
from symgen.chain.model import Closure, Frame, Loops, path_to
from symgen.errors import BuildError
from symgen.kernel import Matrix
from symgen.mechanics.spatial import joint_pose

STEPS = 10  # steps from the assembly pose to q; the next step is predicted by the last two
POLISH = 3  # iterations of Newton at q: they double the digits, and the last step leaves about two
CLOSED = 1e-9  # largest |φ| of a closed pose, m or rad
SINGULAR = 1e-3  # share of the assembly pose's margin below which a posture counts as singular
_TINY = 1e-150  # makes the rotation of a pair of zeros the identity, and changes nothing else


@dataclass(frozen=True, slots=True)
class Triangle:
    """A square system after elimination."""

    upper: Matrix  # (r, r) U
    right: Matrix  # (r, m) Q b, with Q A = U

    @property
    def margin(self) -> Matrix:
        """det A of columns of unit length: ±1 for orthogonal columns, 0 for a singular matrix."""
        share = ca.SX(1)
        for k in range(self.upper.shape[0]):
            column = self.upper[: k + 1, k]
            share = share * self.upper[k, k] / ca.sqrt(ca.dot(column, column) + _TINY**2)
        return share

    def solution(self) -> Matrix:
        """A⁻¹ b, (r, m)."""
        r = self.upper.shape[0]
        x = ca.SX(*self.right.shape)
        for k in reversed(range(r)):
            after = ca.mtimes(self.upper[k, k + 1 :], x[k + 1 :, :]) if k + 1 < r else 0
            x[k, :] = (self.right[k, :] - after) / self.upper[k, k]
        return x


@dataclass(frozen=True, slots=True)
class ClosedChain:
    """Joints, coupling and loop joints of a chain; its functions are made once."""

    joints: tuple[Joint, ...]  # all joints
    coupling: Coupling | None  # q_all = A x + b; None where x are all joints
    loops: Loops  # the loop joints


def closed_chain(chain: Chain) -> ClosedChain:
    """The part of a chain that its loops depend on."""
    if chain.loops is None:
        raise BuildError(f"the robot '{chain.name}' has no loop; use the maps of `kinematics`")
    return ClosedChain(chain.joints, chain.coupling, chain.loops)


def joined(chain: ClosedChain, independent: Matrix, dependent: Matrix | None) -> Matrix:
    """Rows of both kinds, (n, m) and (r, m), in the order of x."""
    whole = ca.SX(_size(chain), independent.shape[1])
    for k, place in enumerate(chain.loops.independent):
        whole[place, :] = independent[k, :]
    if dependent is not None:
        for k, place in enumerate(chain.loops.dependent):
            whole[place, :] = dependent[k, :]
    return whole


@lru_cache(maxsize=8)
def slopes(chain: ClosedChain) -> ca.Function:
    """Function of x (n + r,) that returns ∂φ/∂x, (r, n + r)."""
    x = ca.SX.sym("x", _size(chain))
    return ca.Function("slopes", [x], [ca.jacobian(equations(chain)(x), x)])


@lru_cache(maxsize=8)
def bends(chain: ClosedChain) -> ca.Function:
    """Function of x and ẋ (n + r,) that returns γ = d²φ/dt² for ẍ = 0, (r,)."""
    x, v = ca.SX.sym("x", _size(chain)), ca.SX.sym("v", _size(chain))
    first = ca.jtimes(equations(chain)(x), x, v)
    return ca.Function("bends", [x, v], [ca.jtimes(first, x, v)])


def _size(chain: ClosedChain) -> int:
    return len(chain.loops.independent) + len(chain.loops.dependent)


@lru_cache(maxsize=8)
def equations(chain: ClosedChain) -> ca.Function:
    """Function of x (n + r,) [rad, m] that returns φ (r,) [m, rad]."""
    x = ca.SX.sym("x", _size(chain))
    if chain.coupling is None:
        everything = x
    else:
        linear = ca.mtimes(ca.sparsify(ca.DM(chain.coupling.matrix)), x)
        everything = linear + ca.DM(chain.coupling.offset)
    rows = [_apart(chain, closure, everything) for closure in chain.loops.closures]
    return ca.Function("phi", [x], [ca.densify(ca.vertcat(*rows))])


def _apart(chain: ClosedChain, closure: Closure, positions: Matrix) -> Matrix:
    """Rows of the pose of the child's frame in the parent's, see `symgen.chain.assembly`."""
    above, below = (path_to(chain.joints, f.joint) for f in (closure.parent, closure.child))
    shared = len([a for a, b in zip(above, below, strict=False) if a == b])
    (r_a, a), (r_c, c) = (
        _from_shared(chain, frame, path[shared:], positions)
        for frame, path in ((closure.parent, above), (closure.child, below))
    )
    if closure.kind in IN_SHARED:  # no products of rotations
        return (c - a)[list(closure.rows)]
    r, p = ca.mtimes(r_a.T, r_c), ca.mtimes(r_a.T, c - a)
    free = FREE_ROWS[closure.kind]
    if 5 in free and 4 not in free:
        bent = ca.vertcat(-r[1, 2], r[0, 2], 0)
    else:
        bent = ca.vertcat(r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]) / 2
    return ca.vertcat(p, bent)[list(closure.rows)]


def _from_shared(
    chain: ClosedChain, frame: Frame, path: list[int], positions: Matrix
) -> tuple[Matrix, Matrix]:
    """R and origin of a frame in the last joint that moves both links."""
    rotation, origin = ca.SX(ca.DM(frame.rotation)), ca.SX(ca.DM(frame.translation))
    rotation = ca.sparsify(rotation)
    for joint in reversed(path):
        pose = joint_pose(chain.joints[joint], positions[joint])
        origin = pose.translation + ca.mtimes(pose.rotation, origin)
        rotation = ca.mtimes(pose.rotation, rotation)
    return rotation, origin


def seed_values(chain: ClosedChain, q: Matrix) -> tuple[Matrix, Matrix]:
    """Values of the seeds at q, NaN where a loop cannot close or is singular, and the margins."""
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
    return ca.Function("seeds", [q], list(_polished(chain, q, d, least)))


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
    """`seed_values` at q from the dependent positions d (r,) of a sample shortly before."""
    return _polished(chain, q, d, ca.SX(ca.DM.ones(len(chain.loops.blocks))))


def _newton(chain: ClosedChain, q: Matrix, d: Matrix) -> tuple[Matrix, Matrix]:
    """One step of Newton from d at q, and the margins at d."""
    systems = _systems(chain, q, d)
    return d - _stacked(chain, [s.solution() for s in systems]), _margins(chain, systems)


def _systems(chain: ClosedChain, q: Matrix, d: Matrix, inverse: bool = False) -> list[Triangle]:
    """φ_d y = φ of each block after elimination, or φ_d [y, W] = [φ, 1]."""
    x = joined(chain, q, d)
    phi, slope = equations(chain)(x), slopes(chain)(x)[:, list(chain.loops.dependent)]
    systems = []
    for rows, columns in chain.loops.blocks:
        right: Matrix = phi[list(rows)]
        if inverse:
            right = ca.horzcat(right, ca.SX(ca.DM.eye(len(rows))))
        systems.append(triangle(slope[list(rows), list(columns)], right))
    return systems


def _stacked(chain: ClosedChain, parts: list[Matrix]) -> Matrix:
    """Columns of the blocks as one vector in the order of d."""
    whole = ca.SX(len(chain.loops.dependent), 1)
    for part, (_, columns) in zip(parts, chain.loops.blocks, strict=True):
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


def _polished(chain: ClosedChain, q: Matrix, d: Matrix, least: Matrix) -> tuple[Matrix, Matrix]:
    """Newton at q; values of the seeds and margins, NaN where refused."""
    for _ in range(POLISH):
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


def triangle(matrix: Matrix, right: Matrix) -> Triangle:
    """Eliminate a square system."""
    r = matrix.shape[0]
    upper, turned = ca.SX(matrix), ca.SX(right)
    for k in range(r):
        for i in range(k + 1, r):
            if upper[i, k].is_zero():
                continue
            a, b = upper[k, k] + _TINY, upper[i, k]
            share = 1 / ca.sqrt(a * a + b * b)
            c, s = a * share, b * share
            for m in (upper, turned):
                m[k, :], m[i, :] = c * m[k, :] + s * m[i, :], c * m[i, :] - s * m[k, :]
            upper[i, k] = 0
    return Triangle(upper, turned)
