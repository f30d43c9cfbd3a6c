"""φ(x) = 0 of closed chains on symbols: rows of the poses of the loop joints' frames."""

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from symgen.chain import Chain, Joint
from symgen.chain.coupling import Coupling
from symgen.chain.mechanism import FREE_ROWS, IN_SHARED
from symgen.chain.model import Closure, Frame, Loops
from symgen.errors import BuildError
from symgen.kernel import Matrix
from symgen.mechanics.pose import joint_pose


@dataclass(frozen=True, slots=True)
class ClosedChain:
    """What the equations of loops depend on; functions of it are made once.

    Attributes:
        joints: all joints.
        coupling: q_all = A x + b; None where x are all joints.
        loops: the loop joints.
    """

    joints: tuple[Joint, ...]
    coupling: Coupling | None
    loops: Loops


def closed_chain(chain: Chain) -> ClosedChain:
    """The part of a chain that its loops depend on."""
    if chain.loops is None:
        raise BuildError(f"the robot '{chain.name}' has no loop; use the maps of `coordinates`")
    return ClosedChain(chain.joints, chain.coupling, chain.loops)


def joined(chain: ClosedChain, independent: Matrix, dependent: Matrix | None) -> Matrix:
    """Rows of both kinds in the order of x.

    independent (n, m), dependent (r, m) → (n + r, m).
    """
    loops = chain.loops
    count = len(loops.independent) + len(loops.dependent)
    whole = ca.SX(count, independent.shape[1])
    for k, place in enumerate(loops.independent):
        whole[place, :] = independent[k, :]
    if dependent is not None:
        for k, place in enumerate(loops.dependent):
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
    loops = chain.loops
    return len(loops.independent) + len(loops.dependent)


@lru_cache(maxsize=8)
def equations(chain: ClosedChain) -> ca.Function:
    """Function of x (n + r,) [rad, m] that returns φ (r,) [m, rad]."""
    loops = chain.loops
    x = ca.SX.sym("x", _size(chain))
    if chain.coupling is None:
        everything = x
    else:
        linear = ca.mtimes(ca.sparsify(ca.DM(chain.coupling.matrix)), x)
        everything = linear + ca.DM(chain.coupling.offset)
    rows = [_apart(chain, closure, everything) for closure in loops.closures]
    return ca.Function("phi", [x], [ca.densify(ca.vertcat(*rows))])


def _apart(chain: ClosedChain, closure: Closure, positions: Matrix) -> Matrix:
    """Rows of the pose of the child's frame in the parent's, see `symgen.chain.assembly`."""
    above, below = (_ancestors(chain, f.joint) for f in (closure.parent, closure.child))
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


def _ancestors(chain: ClosedChain, joint: int) -> list[int]:
    """Joints from the base to one joint."""
    path = list[int]()
    while joint >= 0:
        path.append(joint)
        joint = chain.joints[joint].parent
    return path[::-1]


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
