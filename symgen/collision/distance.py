"""Distances between capsules, and of capsules from a plane, with exact gradients in q.

d = |P − Q| − r₁ − r₂ with P, Q the closest points of two segments. By the envelope theorem the
gradient is that of |P − Q| with P and Q fixed in their links: ∂d/∂q_j = n · ż_j(P), n the direction
from Q to P, for each joint j that moves only one of them. Where the segments cross, n is undefined
and the gradient is set to zero; where they are parallel, the closest points are not unique and one
choice is taken. No expression divides by zero.
Source: Ericson, Real-Time Collision Detection, 5.1.9; Danskin's theorem for the gradient.
"""

from dataclasses import dataclass

import casadi as ca

from symgen.chain import Chain
from symgen.collision.model import CollisionModel, Pair, Proxy
from symgen.kernel import Matrix
from symgen.mechanics.kinematics import frames_in_base, independent_forces
from symgen.mechanics.spatial import Pose

_PARALLEL = 1e-12  # sine² of the angle below which two segments are parallel: rounding
_CROSSING = 1e-12  # m; axes closer than this have no direction from one to the other


@dataclass(frozen=True, slots=True)
class _Frame:
    """Pose of a link in the base frame, moment z × o of its joint's axis, joints that move it."""

    pose: Pose
    moment: Matrix
    slides: bool
    movers: frozenset[int]


@dataclass(frozen=True, slots=True)
class _Segment:
    """Axis of a proxy in the base frame; `square` is its constant squared length."""

    start: Matrix
    direction: Matrix
    square: float
    movers: frozenset[int]


def clearance(chain: Chain, model: CollisionModel, q: Matrix) -> tuple[Matrix, Matrix]:
    """Surface distance (n_pairs,) [m] of every pair, negative in overlap, and its gradient."""
    frames = _frames(chain, q)
    segments = {p.name: _segment(chain, model, frames, p) for p in model.proxies}
    rows = [_pair(model, pair, segments, frames) for pair in model.pairs]
    jacobian = ca.vertcat(*(row for _, row in rows))
    return ca.vertcat(*(d for d, _ in rows)), independent_forces(chain, q, jacobian.T).T


def plane_clearance(
    chain: Chain, model: CollisionModel, q: Matrix, plane: Matrix
) -> tuple[Matrix, Matrix]:
    """min over a capsule of n·x − d, (n_moving,) [m], for every moving proxy, and its gradient."""
    frames = _frames(chain, q)
    normal, offset = plane[:3], plane[3]
    distances, rows = [], []
    for proxy in moving(chain, model):
        segment = _segment(chain, model, frames, proxy)
        lowest, height = segment.start, ca.dot(normal, segment.start)
        if segment.square > 0:
            rise = ca.dot(normal, segment.direction)
            # one end is lower than the other, or both are as low
            lowest = lowest + ca.if_else(rise < 0, 1.0, 0.0) * segment.direction
            height = height + ca.fmin(rise, 0.0)
        distances.append(height - offset - proxy.radius)
        rows.append(_row(frames, normal, ca.cross(lowest, normal), segment.movers, frozenset()))
    return ca.vertcat(*distances), independent_forces(chain, q, ca.vertcat(*rows).T).T


def moving(chain: Chain, model: CollisionModel) -> tuple[Proxy, ...]:
    """Proxies that some joint moves, which therefore can meet a plane."""
    links = [joint.link for joint in chain.joints]
    return tuple(p for p in model.proxies if model.joint_of(p, links) >= 0)


def _frames(chain: Chain, q: Matrix) -> list[_Frame]:
    frames: list[_Frame] = []
    for i, (joint, pose) in enumerate(zip(chain.joints, frames_in_base(chain, q), strict=True)):
        movers = frozenset([i])
        if joint.parent >= 0:
            movers |= frames[joint.parent].movers
        moment = ca.cross(pose.axis, pose.translation)
        frames.append(_Frame(pose, moment, joint.kind == "prismatic", movers))
    return frames


def _segment(chain: Chain, model: CollisionModel, frames: list[_Frame], proxy: Proxy) -> _Segment:
    joint = model.joint_of(proxy, [j.link for j in chain.joints])
    start = ca.SX(ca.DM(proxy.start))
    direction = ca.SX(ca.DM(proxy.end) - ca.DM(proxy.start))
    movers: frozenset[int] = frozenset()
    if joint >= 0:
        pose, movers = frames[joint].pose, frames[joint].movers
        start = pose.translation + ca.mtimes(pose.rotation, start)
        direction = ca.mtimes(pose.rotation, direction)
    return _Segment(start, direction, proxy.length * proxy.length, movers)


def _pair(
    model: CollisionModel, pair: Pair, segments: dict[str, _Segment], frames: list[_Frame]
) -> tuple[Matrix, Matrix]:
    a, b = segments[pair.first], segments[pair.second]
    s, t = _closest(a, b)
    p, between = a.start + s * a.direction, a.start - b.start + s * a.direction - t * b.direction
    length = ca.sqrt(ca.dot(between, between))
    normal = between / ca.fmax(length, _CROSSING)
    distance = length - model.named(pair.first).radius - model.named(pair.second).radius
    return distance, _row(frames, normal, ca.cross(p, normal), a.movers, b.movers)


def _closest(a: _Segment, b: _Segment) -> tuple[Matrix, Matrix]:
    """s, t ∈ [0, 1] of the closest points a.start + s·a.direction and b.start + t·b.direction.

    s minimises the distance to the line of b and is clamped; t follows from s and is clamped; s
    follows again from t. A sphere's parameter is 0.
    """
    across = a.start - b.start
    if not a.square and not b.square:
        return 0.0, 0.0
    if not a.square:
        return 0.0, _clamped(ca.dot(b.direction, across) / b.square)
    if not b.square:
        return _clamped(-ca.dot(a.direction, across) / a.square), 0.0
    along_a, along_b = ca.dot(a.direction, across), ca.dot(b.direction, across)
    both = ca.dot(a.direction, b.direction)
    determinant = ca.fmax(a.square * b.square - both * both, _PARALLEL * a.square * b.square)
    s = _clamped((both * along_b - along_a * b.square) / determinant)
    t = _clamped((both * s + along_b) / b.square)
    return _clamped((both * t - along_a) / a.square), t


def _clamped(x: Matrix) -> Matrix:
    return ca.fmin(ca.fmax(x, 0.0), 1.0)


def _row(
    frames: list[_Frame],
    normal: Matrix,
    moment: Matrix,
    first: frozenset[int],
    second: frozenset[int],
) -> Matrix:
    """n · ∂P/∂q_j for joints of `first` only, −n · ∂Q/∂q_j for joints of `second` only.

    n · (z × (P − o)) = z · (P × n) − n · (z × o), and P × n = Q × n as n is along PQ.
    """
    row: list[Matrix] = []
    for j, frame in enumerate(frames):
        if (j in first) == (j in second):
            row.append(ca.SX(1, 1))
            continue
        lever = ca.dot(frame.pose.axis, normal)
        if not frame.slides:
            lever = ca.dot(frame.pose.axis, moment) - ca.dot(normal, frame.moment)
        row.append(lever if j in first else -lever)
    return ca.horzcat(*row)
