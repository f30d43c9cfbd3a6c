"""Assembly pose of closed chains, kinds of their loop joints, and the choice of coordinates.

A loop joint is a pair of frames of two links that coincide. With φ the rows of the pose of the
child's frame in the parent's frame (three of its origin, three of its axes; where axes do not
matter, the difference of the origins),

    φ(x) = 0,   x = (q, d):   d = g(q) by Newton from the assembly pose

All decisions are numerical and made once, at the assembly pose x₀ and at poses beside it:

    x₀            Newton from the stated pose, or from 0 or the middle of the limits
    rows of φ     independent rows of ∂φ/∂x at x₀; a planar loop keeps two or three of six
    coordinates   the joints named, or those that leave ∂φ/∂d well conditioned

Pinocchio gives frames and Jacobians. The same rows as expressions are in
`symgen.mechanics.closure`. Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, Ch. 8.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pinocchio
from numpy.typing import NDArray

from symgen.chain.coupling import Coupling, require_joints
from symgen.chain.document import listing
from symgen.chain.mechanism import FREE_ROWS, IN_SHARED, Loop, Mechanism
from symgen.chain.model import Closure, Frame, Joint, Loops, rows_of, snapped
from symgen.errors import UrdfError

Array = NDArray[np.float64]

_NEAR = 1e-3  # m, rad between two frames at the start, below which they are meant to coincide
_ASIDE = 0.05  # rad, m: how far poses beside the assembly pose are
_POSES = 3
_MOST_CHOICES = 20_000
_DIGITS = 12
"""Decimals of the assembly pose: it starts an iteration, so that its last digits do not matter."""
CLOSED = 1e-10  # distance of frames [m, rad] that counts as closed; Newton ends at rounding error
SINGULAR = 1e-6  # singular value of ∂φ/∂x over the largest, below which a direction is lost
_NEWTON, _LONGEST = 60, 0.3  # iterations of Newton; longest step in a joint, rad or m
_EYE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Tree:
    """The chain without its loops: x_all = A x + b, frames by pinocchio."""

    model: pinocchio.Model  # of N joints
    names: tuple[str, ...]  # of the n joints whose positions are x
    matrix: Array  # (N, n) A
    offset: Array  # (N,) b [rad, m]

    def rows(self, closures: list[Closure], x: Array) -> tuple[Array, Array]:
        """φ and ∂φ/∂x of all loop joints at x (n,) [rad, m]."""
        data = self.model.createData()
        pinocchio.computeJointJacobians(self.model, data, self.matrix @ x + self.offset)
        values, slopes = [], []
        for closure in closures:
            value, slope = _apart(self.model, data, closure)
            values.append(value[list(closure.rows)])
            slopes.append(slope[list(closure.rows)] @ self.matrix)
        return np.concatenate(values), np.vstack(slopes)


def close_loops(
    model: pinocchio.Model,
    joints: tuple[Joint, ...],
    coupling: Coupling | None,
    mechanism: Mechanism,
) -> Loops | None:
    """Loops of a mechanism; None without any."""
    names = [joint.name for joint in joints]
    require_joints(mechanism.assembly, names, "[assembly]")
    if not mechanism.loop:
        return None
    require_joints(mechanism.independent, names, "independent")
    count = len(joints)
    free = tuple(range(count)) if coupling is None else coupling.independent
    matrix = np.eye(count) if coupling is None else np.array(coupling.matrix)
    offset = np.zeros(count) if coupling is None else np.array(coupling.offset)
    tree = Tree(model, tuple(names[k] for k in free), matrix, offset)
    chosen = [tree.names.index(n) for n in mechanism.independent if n in tree.names]
    if len(chosen) < len(set(mechanism.independent)):
        raise UrdfError(
            f"independent names {listing(mechanism.independent)}, of which some follow others by a "
            f"coupling; choose among {listing(tree.names)}"
        )
    start = np.array([_position(joints[k], mechanism.assembly) for k in free])
    closures = [_closure(model, loop) for loop in mechanism.loop]
    closures, x = _with_kinds(tree, closures, start, chosen)
    beside = [x, *_poses_beside(tree, closures, x)]
    slopes = [tree.rows(closures, pose)[1] for pose in beside]
    rank = max(_rank(slope) for slope in slopes)
    if len(beside) == 1:
        also = "" if coupling is None else " and the couplings"
        raise UrdfError(
            f"with {listing([c.name for c in closures])}{also} no joint can move; remove one of "
            f"them, give a loop another kind ({', '.join(FREE_ROWS)}), or correct its frames"
        )
    if _rank(slopes[0]) < rank:
        pose = (f"{name} = {q:.3g}" for name, q in zip(tree.names, beside[1], strict=True))
        raise UrdfError(
            f"the assembly pose of {closures[0].name} is singular: there the joints are not "
            "determined by each other; state another pose under [assembly], such as "
            f"{', '.join(pose)}"
        )
    rows = _independent_rows(slopes[0], rank)
    dependent = _dependent(tree, slopes[0][rows], chosen)
    independent = chosen or [k for k in range(len(free)) if k not in dependent]
    at = np.cumsum([0, *(len(c.rows) for c in closures)])
    closed = tuple(
        replace(c, rows=tuple(c.rows[r - at[k]] for r in rows if at[k] <= r < at[k + 1]))
        for k, c in enumerate(closures)
    )
    blocks = _blocks([slope[rows][:, dependent] for slope in slopes])
    assembly = tuple(float(v) for v in np.round(x, _DIGITS) + 0.0)
    return Loops(closed, tuple(independent), tuple(dependent), blocks, assembly)


def _position(joint: Joint, assembly: dict[str, float]) -> float:
    """Stated position, else 0, else the middle of limits that exclude 0."""
    if joint.name in assembly:
        return assembly[joint.name]
    if joint.lower is None or joint.upper is None or joint.lower <= 0 <= joint.upper:
        return 0.0
    return (joint.lower + joint.upper) / 2


def _closure(model: pinocchio.Model, loop: Loop) -> Closure:
    """The frames of a loop joint with the z axis along that of the joint."""
    turn = pinocchio.Quaternion.FromTwoVectors(np.array([0, 0, 1.0]), np.array(loop.axis))
    parent = (loop.parent, loop.parent_xyz, loop.parent_rpy)
    frames = []
    for link, xyz, rpy in (parent, (loop.child, loop.child_xyz, loop.child_rpy)):
        if not model.existFrame(link, pinocchio.BODY):
            links = [frame.name for frame in model.frames if frame.type == pinocchio.BODY]
            raise UrdfError(
                f"{loop.name} names the link '{link}', which this robot does not have; its links "
                f"are {listing(links)}"
            )
        frame = model.frames[model.getFrameId(link, pinocchio.BODY)]
        here = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(np.array(rpy)), np.array(xyz))
        placed = frame.placement * here
        rows = rows_of(placed.rotation @ turn.matrix())
        frames.append(Frame(int(frame.parentJoint) - 1, rows, snapped(placed.translation)))
    if frames[0].joint == frames[1].joint:
        raise UrdfError(
            f"{loop.name} connects links that do not move relative to each other; name two links "
            "between which joints move"
        )
    return Closure(loop.name, loop.kind, frames[0], frames[1], ())


def _as(closures: list[Closure], kind: str) -> list[Closure]:
    """The closures, those without a kind with this one; rows are all that it closes."""
    named = [replace(c, kind=c.kind or kind) for c in closures]
    return [
        replace(c, rows=tuple(k for k in range(6) if k not in FREE_ROWS[c.kind])) for c in named
    ]


def _with_kinds(
    tree: Tree, closures: list[Closure], start: Array, chosen: list[int]
) -> tuple[list[Closure], Array]:
    """Closures with their kinds, and the assembly pose.

    Without a kind, frames that coincide with their axes at the start are fixed, if joints are left
    to move, as many as are named independent. Else only the origins coincide.
    """
    fixed, point = _as(closures, "fixed"), _as(closures, "spherical")
    if all(c.kind for c in closures):
        return fixed, _closed(tree, fixed, start, chosen)
    gap = np.abs(tree.rows(point, start)[0]).max()
    if gap < _NEAR and np.abs(tree.rows(fixed, start)[0]).max() > _NEAR:
        return point, _closed(tree, point, start, chosen)
    try:
        x = _closed(tree, fixed, start, chosen)
    except UrdfError:
        return point, _closed(tree, point, start, chosen)
    poses = _poses_beside(tree, fixed, x)
    left = len(start) - max((_rank(tree.rows(fixed, p)[1]) for p in poses), default=len(start))
    if left > 0 and (left == len(chosen) if chosen else gap < _NEAR):
        return fixed, x
    return point, _closed(tree, point, start, chosen)


def _closed(tree: Tree, closures: list[Closure], start: Array, chosen: list[int]) -> Array:
    """The pose at which all loops close, by damped Newton; independent joints stay if they can."""
    every = list(range(len(start)))
    for columns in ([k for k in every if k not in chosen], every):
        end = _newton_pose(tree, closures, start, columns)
        if _is_closed(tree, closures, end):
            return end
    worst = max(closures, key=lambda c: float(np.abs(tree.rows([c], end)[0]).max()))
    raise UrdfError(
        f"{worst.name} cannot be closed: its frames are {_apart_at(tree, worst, start)} apart at "
        f"the start and {_apart_at(tree, worst, end)} where Newton ends; correct parent_xyz, "
        "parent_rpy, child_xyz, child_rpy, or state positions near the closed pose under [assembly]"
    )


def _poses_beside(tree: Tree, closures: list[Closure], x: Array) -> list[Array]:
    """Closed poses near x along free directions of ∂φ/∂x; bars on one line have none."""
    rng, poses = np.random.default_rng(0), []
    slope = tree.rows(closures, x)[1]
    free = np.linalg.svd(slope)[2][_rank(slope) :]
    for _ in range(_POSES if len(free) else 0):
        direction = rng.normal(0, 1, len(free)) @ free
        start = x + _ASIDE * direction / np.linalg.norm(direction)
        pose = _newton_pose(tree, closures, start, list(range(len(x))))
        if _is_closed(tree, closures, pose) and np.linalg.norm(pose - x) > _ASIDE / 4:
            poses.append(pose)
    return poses


def _rank(slope: Array) -> int:
    sigma = np.linalg.svd(slope, compute_uv=False)
    return int((sigma > SINGULAR * max(sigma[0], 1e-300)).sum())


def _independent_rows(slope: Array, rank: int) -> list[int]:
    """Rows that span the others: greedily the one farthest from the span of those before."""
    left, rows = slope.copy(), list[int]()
    for _ in range(rank):
        lengths = np.linalg.norm(left, axis=1)
        # the first of nearly equal rows, so that rounding does not decide
        row = int(np.flatnonzero(lengths > lengths.max() * (1 - 1e-6))[0])
        rows.append(row)
        unit = left[row] / lengths[row]
        left = left - np.outer(left @ unit, unit)
    return sorted(rows)


def _dependent(tree: Tree, slope: Array, chosen: list[int]) -> list[int]:
    """Coordinates that the rows determine, by name or by the condition of ∂φ/∂d."""
    rank, count = slope.shape
    if chosen:
        dependent = [k for k in range(count) if k not in chosen]
        if len(dependent) != rank or _least(slope[:, dependent]) < SINGULAR:
            suggested = [k for k in range(count) if k not in _dependent(tree, slope, [])]
            raise UrdfError(
                f"the independent joints {listing(tree.names[k] for k in chosen)} do not determine "
                f"the others at the assembly pose; this mechanism has {count - rank} of them, such "
                f"as {listing(tree.names[k] for k in suggested)}"
            )
        return dependent
    moved = [k for k in range(count) if np.abs(slope[:, k]).max() > SINGULAR * np.abs(slope).max()]
    choices = []
    for k, places in enumerate(combinations(reversed(moved), rank)):
        choices.append(places)
        if k > _MOST_CHOICES:
            break
    least = np.array([_least(slope[:, places]) for places in choices])
    # the last joints depend on the first ones where that costs at most half of the condition
    best = int(np.flatnonzero(least >= 0.5 * least.max())[0])
    return sorted(choices[best])


def _least(square: Array) -> float:
    sigma = np.linalg.svd(square, compute_uv=False)
    return float(sigma[-1] / max(sigma[0], 1e-300))


def _blocks(squares: list[Array]) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """Rows and columns of the connected parts of a square matrix, by its entries at some poses."""
    size = np.max([np.abs(square) for square in squares], axis=0)
    linked = size > CLOSED * size.max()
    left, blocks = set(range(len(linked))), []
    while left:
        rows, columns = {min(left)}, set[int]()
        while True:
            wider = {int(c) for r in rows for c in np.flatnonzero(linked[r])}
            taller = {int(r) for c in wider for r in np.flatnonzero(linked[:, c])}
            if wider == columns and taller == rows:
                break
            rows, columns = taller | rows, wider
        blocks.append((tuple(sorted(rows)), tuple(sorted(columns))))
        left -= rows
    return tuple(blocks)


def _apart(model: pinocchio.Model, data: pinocchio.Data, closure: Closure) -> tuple[Array, Array]:
    """Six components of the pose of the child's frame in the parent's, and their Jacobian."""
    frames = (closure.parent, closure.child)
    (r_a, a, j_a), (r_c, c, j_c) = (_placed(model, data, frame) for frame in frames)
    if closure.kind in IN_SHARED:
        shared = _shared(model, closure)
        if shared:
            r_s, _, j_s = _placed(model, data, Frame(shared - 1, _EYE, (0.0, 0.0, 0.0)))
        else:
            r_s, j_s = np.eye(3), np.zeros((6, model.nv))
        slope = r_s.T @ (j_c[:3] - j_a[:3] + pinocchio.skew(c - a) @ j_s[3:])
        return np.concatenate([r_s.T @ (c - a), np.zeros(3)]), np.vstack([slope, 0 * slope])
    r, p = r_a.T @ r_c, r_a.T @ (c - a)
    turn = r_a.T @ (j_c[3:] - j_a[3:])  # δ of dR = [δ×] R
    shift = r_a.T @ (j_c[:3] - j_a[:3] + pinocchio.skew(c - a) @ j_a[3:])
    if 5 in FREE_ROWS[closure.kind] and 4 not in FREE_ROWS[closure.kind]:
        z = r[:, 2]  # d z = δ × z; to first order (−z_y, z_x) is the turn about x and y
        slope = -pinocchio.skew(z) @ turn
        bent, slopes = np.array([-z[1], z[0], 0.0]), np.vstack([-slope[1], slope[0], 0 * slope[2]])
    else:  # vee of the skew part of R; d = (tr R 1 − R) δ / 2
        bent = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
        slopes = (np.trace(r) * np.eye(3) - r) @ turn / 2
    return np.concatenate([p, bent]), np.vstack([shift, slopes])


def _shared(model: pinocchio.Model, closure: Closure) -> int:
    """Pinocchio's index of the last joint that moves both links, 0 for the base."""
    frames = (closure.parent, closure.child)
    above, below = (set(model.supports[frame.joint + 1]) for frame in frames)
    return int(max(above & below))


def _placed(
    model: pinocchio.Model, data: pinocchio.Data, frame: Frame
) -> tuple[Array, Array, Array]:
    """R, origin and (6, N) Jacobian of a frame in axes of the base."""
    place = pinocchio.SE3(np.array(frame.rotation), np.array(frame.translation))
    if frame.joint < 0:
        return place.rotation, place.translation, np.zeros((6, model.nv))
    at = data.oMi[frame.joint + 1]
    jacobian = pinocchio.getJointJacobian(
        model, data, frame.joint + 1, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    ).copy()
    world = at * place
    jacobian[:3] -= pinocchio.skew(world.translation - at.translation) @ jacobian[3:]
    return world.rotation, world.translation, jacobian


def _is_closed(tree: Tree, closures: list[Closure], x: Array) -> bool:
    return bool(np.abs(tree.rows(closures, x)[0]).max() < CLOSED)


def _newton_pose(tree: Tree, closures: list[Closure], start: Array, columns: list[int]) -> Array:
    """The pose where damped Newton ends, closed or not, (n,) [rad, m]."""
    x = start.copy()
    for _ in range(_NEWTON):
        value, slope = tree.rows(closures, x)
        if np.abs(value).max() < CLOSED / 1e3:
            return x
        step = np.linalg.lstsq(slope[:, columns], -value, rcond=SINGULAR)[0]
        x[columns] += step * min(1.0, _LONGEST / max(np.abs(step).max(), 1e-300))
    return x


def _apart_at(tree: Tree, closure: Closure, x: Array) -> str:
    """Distance of the frames of a loop at a pose x (n,), with the angle where the loop fixes it."""
    value, _ = tree.rows([replace(closure, kind="fixed", rows=(0, 1, 2, 3, 4, 5))], x)
    along = ", ".join(f"{v:.3g}" for v in np.round(value[:3], 6) + 0.0)
    turn = ""
    if any(row > 2 for row in closure.rows):
        turn = f" and {np.arcsin(min(1.0, float(np.linalg.norm(value[3:])))):.3g} rad"
    return f"{np.linalg.norm(value[:3]):.3g} m ({along} in the parent's frame){turn}"
