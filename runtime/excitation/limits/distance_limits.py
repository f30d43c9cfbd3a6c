"""Limits of places and distances as constraints: g ≤ 0 in units of 0.1 m, with exact slopes.

| constraint | row | g |
|---|---|---|
| tip box | axis and side | (p − upper) / 0.1 m, (lower − p) / 0.1 m |
| tip speed | | (v²/v_max² − 1) / 2 |
| self-collision | pair, or a box in the hand and a link | (margin − distance) / 0.1 m |
| table | proxy, or the lowest corner of a box | (margin − height) / 0.1 m |
| obstacle | obstacle and capsule | (margin − distance) / 0.1 m |

A carried box counts at obstacles as the capsule around it, whose axis is parallel to the longest
edge. The distance of a capsule is that of its axis p(s) = p₀ + s d, 0 ≤ s ≤ 1, from the box
|x_i| ≤ h_i, less its radius. With e(s) = p − clip(p, −h, h) the square |e|² is convex in s, and its
half slope e · d is piecewise linear with kinks where p_i = ±h_i: its zero is exact. The slope of
the distance is that of |P − Q| with both closest points fixed in their links. Source: Danskin's
theorem.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from runtime.excitation.limits.nonlinear_limits import (
    ROUNDING,
    SMOOTH,
    Body,
    Constraint,
    IntervalBounds,
    SampledMotion,
    times,
)
from runtime.library import Array, Indices, Library, Mask, ProxyFacts

LENGTH = 0.1  # unit of distances in constraints, m: what is missing or left by this is one limit
OBSTACLE = "obstacle"  # kind of the limit in certificates
LABEL = "carried body"
_INSIDE = 1e-12  # distance of an axis from the box, m, without a direction: it is inside
NEAR_AND_FAR = 2e-5, 9e-5  # tolerances of proven distances: 2 µm near the margin, else 9 µm


@dataclass(frozen=True, slots=True)
class TipBox:
    """Box of the tip, lower ≤ p ≤ upper, (3,) m in the base frame; ±inf leaves a side open."""

    kind: ClassVar[str] = "tip box"
    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = SMOOTH
    labels: ClassVar[tuple[str, ...]] = ("x max", "y max", "z max", "x min", "y min", "z min")
    lib: Library
    lower: Array
    upper: Array

    def values(self, motion: Array) -> Array:
        """Values p − upper and lower − p, in 0.1 m."""
        p = self.lib.tip_motion(motion[0], motion[1])[0]
        return np.concatenate([p - self.upper, self.lower - p], axis=1) / LENGTH

    def slopes(self, motion: Array) -> Array:
        """Slopes ±∂p/∂q."""
        slope = self.lib.tip_motion(motion[0], motion[1])[2][:, :, None] / LENGTH
        return np.concatenate([slope, -slope], axis=1)

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values, and rates from ±v."""
        p, v, _ = sampled.tip
        g = np.concatenate([p - self.upper, self.lower - p], axis=1) / LENGTH
        return g, np.concatenate([v, -v], axis=1) / LENGTH

    def rise(self, bounds: IntervalBounds) -> Array:
        """Rise by d²p/dt²."""
        p, _, second, _ = bounds.tip
        rise = bounds.bend(second) + ROUNDING * p
        return np.repeat(rise[:, None] / LENGTH, len(self.labels), axis=1)

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Coordinate of the tip at a value of the constraint."""
        end = float(np.concatenate([self.upper, self.lower])[row])
        return end + g * (LENGTH if row < 3 else -LENGTH), end, "m"


@dataclass(frozen=True, slots=True)
class TipSpeed:
    """Speed of the tip, v ≤ limit [m/s]; squared, because v itself has no slope at rest."""

    kind: ClassVar[str] = "tip speed"
    orders: ClassVar[int] = 2
    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = SMOOTH
    labels: ClassVar[tuple[str, ...]] = ("tip",)
    lib: Library
    limit: float

    def values(self, motion: Array) -> Array:
        """(v²/v_max² − 1) / 2."""
        v = self.lib.tip_motion(motion[0], motion[1])[1]
        return (np.einsum("ni,ni->n", v, v)[:, None] / self.limit**2 - 1) / 2

    def slopes(self, motion: Array) -> Array:
        """v · ∂v/∂(q, dq) / v_max², with ∂v/∂dq = ∂p/∂q."""
        _, v, by_speed, by_position = self.lib.tip_motion(motion[0], motion[1])
        slope = np.stack([by_position, by_speed], axis=2)  # ∂v/∂dq = ∂p/∂q
        return np.einsum("ni,nidj->ndj", v, slope)[:, None] / self.limit**2

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values, and rates v · dv/dt / v_max²."""
        _, v, dv = sampled.tip
        square, rate = (np.einsum("ni,ni->n", v, x)[:, None] / self.limit**2 for x in (v, dv))
        return (square - 1) / 2, rate

    def rise(self, bounds: IntervalBounds) -> Array:
        """Rise by v · d²v/dt² + (dv/dt)²."""
        _, v, dv, ddv = bounds.tip
        rise = bounds.bend(v * ddv + dv**2) + ROUNDING * v**2
        return rise[:, None] / self.limit**2

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Speed of the tip at a value of the constraint."""
        return self.limit * float(np.sqrt(max(0.0, 1 + 2 * g))), self.limit, "m/s"


class Clearance(ABC):
    """Constraint (margin − distance) / 0.1 m of R distances, with one margin or one per row [m]."""

    orders: ClassVar[int] = 1
    even: ClassVar[bool] = True
    precision: ClassVar[tuple[float, float]] = NEAR_AND_FAR
    lib: Library
    margin: Array | float

    @abstractmethod
    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distances (N, R) m at positions (N, n), and their slopes by q, (N, R, n)."""

    @abstractmethod
    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""

    def distances(self, motion: Array) -> Array:
        """Distance of every row, (N, R) m."""
        return self.distances_and_slopes(motion[0])[0]

    def values(self, motion: Array) -> Array:
        """Values margin − distance, in 0.1 m."""
        return np.asarray((self.margin - self.distances(motion)) / LENGTH)

    def slopes(self, motion: Array) -> Array:
        """Slopes −∂distance/∂q."""
        return -self.distances_and_slopes(motion[0])[1][:, :, None] / LENGTH

    def along(self, sampled: SampledMotion) -> tuple[Array, Array]:
        """Values, and rates −∂distance/∂q dq."""
        distance, slope = self.distances_and_slopes(sampled.motion[0])
        rate = times(slope, sampled.motion[1]) / -LENGTH
        return (self.margin - distance) / LENGTH, rate

    def rise(self, bounds: IntervalBounds) -> Array:
        """Rise by half a step from the nearer end; distances have corners in time."""
        # Coordinates are a few times smaller than 10 m.
        return (bounds.step / 2 * self.approaches(bounds) + 10 * ROUNDING) / LENGTH

    def measured(self, row: int, g: float) -> tuple[float, float, str]:
        """Distance of a row at a value of the constraint.

        Args:
            row: index of the row.
            g: value of the constraint there.

        Returns:
            Distance and margin [m] and their unit.
        """
        margin = float(self.margin if np.ndim(self.margin) == 0 else np.asarray(self.margin)[row])
        return margin - g * LENGTH, margin, "m"


@dataclass(frozen=True, slots=True)
class LinkClearance(Clearance):
    """Distances between links, each pair with its margin [m]."""

    kind: ClassVar[str] = "self-collision"
    lib: Library
    margin: Array
    labels: tuple[str, ...]  # both links of every pair

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distance of every pair, (N, R) m, and its slopes by q, (N, R, n)."""
        return self.lib.clearance(q)

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""
        bodies = {proxy.name: body_of(proxy) for proxy in self.lib.proxies}
        pairs = ((bodies[pair.first], bodies[pair.second]) for pair in self.lib.pairs)
        return np.stack([bounds.approach(*pair) for pair in pairs], axis=1)


@dataclass(frozen=True, slots=True)
class TableClearance(Clearance):
    """Heights of proxies above the plane z = height of the base frame, with a margin [m]."""

    kind: ClassVar[str] = "table"
    lib: Library
    height: float
    margin: float
    labels: tuple[str, ...]  # names of the proxies
    rows: Indices  # indices of those proxies among the moving ones

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Height of every proxy above the table, (N, R) m, and its slopes by q, (N, R, n)."""
        heights, slopes = self.lib.plane_clearance(q, np.array([0.0, 0.0, 1.0, self.height]))
        return heights[:, self.rows], slopes[:, self.rows]

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bounds of the rates of the heights, (K, R) m/s."""
        bodies = {proxy.name: body_of(proxy) for proxy in self.lib.proxies}
        return np.stack([bounds.approach(bodies[name]) for name in self.labels], axis=1)


def body_of(proxy: ProxyFacts) -> Body:
    """A proxy as a body; the axis of a capsule keeps its radius from the surface."""
    reach = float(np.linalg.norm([proxy.start, proxy.end], axis=1).max())
    return Body(proxy.joint, reach)


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses of the joints at N samples."""

    rotation: Array  # (N, n, 3, 3)
    origin: Array  # (N, n, 3) m
    axis: Array  # axes of the joints in the base frame, (N, n, 3)
    slides: Mask  # joints that slide, (n,)
    movers: Mask  # movers[i, j] where joint j moves link i, (n, n)

    @classmethod
    def at(cls, lib: Library, q: Array) -> "Poses":
        """Poses of a robot at positions q (N, n) [rad, m]."""
        joints = lib.manifest.joints
        poses = lib.link_poses(q)
        movers = np.eye(len(joints), dtype=bool)
        for j, joint in enumerate(joints):
            if joint.parent >= 0:
                movers[j] |= movers[joint.parent]
        axes = np.einsum("tnij,nj->tni", poses[..., :3, :3], [joint.axis for joint in joints])
        slides = np.array([joint.kind == "prismatic" for joint in joints])
        return cls(poses[..., :3, :3], poses[..., :3, 3], axes, slides, movers)

    def placed(self, joint: int, point: Array) -> Array:
        """Places (N, 3) in the base frame of a point (3,) of a link."""
        if joint < 0:
            return np.broadcast_to(point, (len(self.origin), 3))
        return np.asarray(self.rotation[:, joint] @ point + self.origin[:, joint])

    def moved_by(self, joint: int) -> Mask:
        """Joints that move a link, (n,)."""
        return self.movers[joint] if joint >= 0 else np.zeros(len(self.slides), dtype=bool)

    def slopes(self, point: Array, normal: Array) -> Array:
        """Slopes n · ∂P/∂q_j, (N, n), of points (N, 3) for every joint, as if each moved them."""
        turned = np.cross(self.axis, point[:, None] - self.origin)
        return np.einsum("tni,ti->tn", np.where(self.slides[:, None], self.axis, turned), normal)


def closest(start: Array, direction: Array, half: Array) -> tuple[Array, Array]:
    """Points (N, 3) of segments nearest to the box |x_i| ≤ h_i, and the ways there from the box."""

    def way(s: Array) -> Array:
        p = start[:, None] + s[..., None] * direction[:, None]
        return np.asarray(p - np.clip(p, -half, half))

    # Kinks of the slope, in order, with both ends of the segment: 8 values of s per segment.
    with np.errstate(divide="ignore", invalid="ignore"):
        kinks = np.concatenate([(half - start) / direction, (-half - start) / direction], axis=1)
    kinks = np.clip(np.nan_to_num(kinks, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    s = np.sort(np.pad(kinks, ((0, 0), (1, 1)), constant_values=((0, 0), (0, 1))), axis=1)
    slope = np.einsum("tki,ti->tk", way(s), direction)
    # The slope grows with s. Its zero lies before the first kink where it is not negative.
    after = np.where(slope[:, -1] < 0, s.shape[1] - 1, np.argmax(slope >= 0, axis=1))
    before = np.maximum(after - 1, 0)
    row = np.arange(len(s))
    low, high = slope[row, before], slope[row, after]
    share = np.where((low < 0) & (high > 0), -low / np.where(high > low, high - low, 1.0), 1.0)
    best = s[row, before] + share * (s[row, after] - s[row, before])
    return start + best[:, None] * direction, way(best[:, None])[:, 0]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedBox:
    """A box grown by a radius, rigid in the link of a joint, or in the base frame (joint −1)."""

    joint: int
    center: Array  # (3,) m in the frame of the link
    rotation: Array  # axes of the box there, columns of (3, 3)
    half: Array  # half of its edges, (3,) m
    radius: float = 0.0  # m

    @property
    def body(self) -> Body:
        """The box as a body: no corner is farther than its centre and half a diagonal."""
        return Body(self.joint, float(np.linalg.norm(self.center) + np.linalg.norm(self.half)))

    def frames(self, poses: Poses) -> tuple[Array, Array]:
        """Axes (N, 3, 3) and centres (N, 3) in the base frame of a box in a moving link."""
        return poses.rotation[:, self.joint] @ self.rotation, poses.placed(self.joint, self.center)

    def nearest(self, poses: Poses, ends: Array) -> tuple[Array, Array, Array]:
        """Distance (N,), point and direction of axes with ends (N, 2, 3) from the box; 0 inside."""
        if self.joint < 0:
            axes, center = self.rotation, self.center
            local = (ends - center) @ axes
        else:
            axes, center = self.frames(poses)
            first, last = (np.einsum("tji,tj->ti", axes, ends[:, k] - center) for k in (0, 1))
            local = np.stack([first, last], axis=1)
        point, way = closest(local[:, 0], local[:, 1] - local[:, 0], self.half)
        length = np.linalg.norm(way, axis=1)
        unit = way / np.where(length > _INSIDE, length, np.inf)[:, None]
        if self.joint < 0:
            return length, point @ axes.T + center, unit @ axes.T
        place, normal = (np.einsum("tij,tj->ti", axes, each) for each in (point, unit))
        return length, place + center, normal


@dataclass(frozen=True, slots=True, eq=False)
class BoxClearance(Clearance):
    """Distances of capsules from boxes, those from the first box first."""

    kind: str  # "self-collision" of the box in the hand, or `OBSTACLE`
    labels: tuple[str, ...]  # box and capsule of every row
    lib: Library
    margin: float
    boxes: tuple[PlacedBox, ...]
    proxies: tuple[ProxyFacts, ...]

    def distances(self, motion: Array) -> Array:
        """Distance of every row, (N, R) m, without slopes."""
        rows = self._nearest(Poses.at(self.lib, motion[0]))
        return np.stack([one for *_, one, _, _ in rows], axis=1)

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distance of every row, (N, R) m, and its slopes by q, (N, R, n)."""
        poses = Poses.at(self.lib, q)
        distances, slopes = [], []
        for box, proxy, distance, place, normal in self._nearest(poses):
            # Joints that move both or neither leave the distance; the line P Q has one moment.
            sign = poses.moved_by(proxy.joint).astype(float) - poses.moved_by(box.joint)
            distances.append(distance)
            slopes.append(sign * poses.slopes(place, normal))
        return np.stack(distances, axis=1), np.stack(slopes, axis=1)

    def _nearest(self, poses: Poses) -> Iterator[tuple[PlacedBox, ProxyFacts, Array, Array, Array]]:
        """Per row box, capsule, distance (N,), point of the axis and direction from the box."""
        axes = [
            np.stack([poses.placed(p.joint, np.array(end)) for end in (p.start, p.end)], axis=1)
            for p in self.proxies
        ]
        for box in self.boxes:
            for proxy, ends in zip(self.proxies, axes, strict=True):
                length, place, normal = box.nearest(poses, ends)
                yield box, proxy, length - proxy.radius - box.radius, place, normal

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""
        pairs = ((box.body, body_of(proxy)) for box in self.boxes for proxy in self.proxies)
        return np.stack([bounds.approach(*pair) for pair in pairs], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class CarriedHeight(Clearance):
    """Height of the lowest corner of a box in the hand above a horizontal plane."""

    kind: ClassVar[str] = "table"
    labels: ClassVar[tuple[str, ...]] = (LABEL,)
    lib: Library
    margin: float
    box: PlacedBox
    height: float

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Height of the lowest corner, (N, 1) m, and its slopes by q, (N, 1, n)."""
        poses = Poses.at(self.lib, q)
        axes, center = self.box.frames(poses)
        # Of every edge the end that lies lower.
        corner = -np.where(axes[:, 2] < 0, -1.0, 1.0) * self.box.half
        lowest = center + np.einsum("tij,tj->ti", axes, corner)
        up = np.broadcast_to([0.0, 0.0, 1.0], lowest.shape)
        slope = poses.slopes(lowest, up) * poses.moved_by(self.box.joint)
        return lowest[:, 2:] - self.height, slope[:, None]

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bound of the rate of the height, (K, 1) m/s."""
        return bounds.approach(self.box.body)[:, None]


def capsule_around(box: PlacedBox) -> ProxyFacts:
    """Capsule that contains a carried box, with its axis parallel to the longest edge."""
    longest = int(np.argmax(box.half))
    radius = float(np.hypot(*np.delete(2 * box.half, longest))) / 2
    half = box.rotation[:, longest] * box.half[longest]
    first, last = (tuple((box.center + s * half).tolist()) for s in (-1, 1))
    return ProxyFacts(LABEL, LABEL, box.joint, first, last, radius)


def use_of(constraint: Constraint, g: float) -> float:
    """Use of a limit, 1 on the limit: 1 + g, and v / v_max for the speed, whose g is in squares."""
    if isinstance(constraint, TipSpeed):
        return constraint.measured(0, g)[0] / constraint.limit
    return 1 + g
