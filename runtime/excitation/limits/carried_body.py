"""A body in the hand, and obstacles: shares of torques, and distances with exact slopes.

The body is rigid in a moving link. It adds its ten parameters to those of the link; its box keeps
a distance from the capsules of the other links and from a table. Its files are read elsewhere.
An obstacle is a box fixed in the base frame and grown by a radius, which includes spheres (no
edges) and capsules (one edge); a carried box counts there as the capsule around it, whose axis is
parallel to the longest edge.

| constraint | row | g |
|---|---|---|
| self-collision | capsule of another link | (margin − distance) / 0.1 m |
| table | the box | (margin − height of the lowest corner) / 0.1 m |
| obstacle | obstacle and capsule | (margin − distance) / 0.1 m |

The distance of a capsule is that of its axis p(s) = p₀ + s d, 0 ≤ s ≤ 1, from the box |x_i| ≤ h_i,
less its radius. With e(s) = p − clip(p, −h, h) the square |e|² is convex in s, and its half slope
e · d is piecewise linear with kinks where p_i = ±h_i: its zero is exact. The slope of the distance
is that of |P − Q| with both closest points fixed in their links. Source: Danskin's theorem.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from msgspec.structs import asdict
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from runtime.common.records import Record, Vector3, record_from_toml
from runtime.errors import IdentificationError
from runtime.excitation.limits.distance_limits import Clearance, body_of
from runtime.excitation.limits.nonlinear_limits import Body, IntervalBounds
from runtime.library import Array, Library, ProxyFacts
from runtime.library.parameters import link_columns

EMPTY_HAND = "empty hand"
"""What a certificate states of the load where no body is carried."""
LABEL = "carried body"
_INSIDE = 1e-12
"""Distance of an axis from the box, m, below which it has no direction: the axis is inside."""


@dataclass(frozen=True, slots=True)
class CarriedBox:
    """A box fixed in a link; picklable."""

    center: tuple[float, ...]  # in the link's frame, (3,) m
    rotation: tuple[tuple[float, ...], ...]  # axes of the box in the link's frame, rows of (3, 3)
    size: tuple[float, ...]  # lengths of its edges, (3,) m

    def __post_init__(self) -> None:
        if not (np.isfinite([*self.center, *self.size]).all() and min(self.size) > 0):
            raise IdentificationError(
                "the box of a carried body needs a finite place and edges above 0 m, got edges of "
                f"{', '.join(f'{x:g}' for x in self.size)} m"
            )


@dataclass(frozen=True, slots=True)
class CarriedBody:
    """A body that moves with a link; picklable."""

    link: int  # index of the moving link that carries it
    pi: tuple[float, ...]  # its parameters in that link's frame, (10,): kg, kg·m ×3, kg·m² ×6
    box: CarriedBox | None = None  # box around it, or None where its shape is not known

    @property
    def sentence(self) -> str:
        """Mass and box, for certificates."""
        if self.box is None:
            return f"{self.pi[0]:g} kg, no box"
        edges = " x ".join(f"{1e3 * edge:g}" for edge in self.box.size)
        return f"{self.pi[0]:g} kg in a box of {edges} mm"


def with_load(pi: Array, body: CarriedBody | None) -> Array:
    """Parameters (10 n,) of the links with a carried body, π_link + π_body."""
    if body is None:
        return pi
    loaded = pi.copy()
    loaded[link_columns(body.link)] += body.pi
    return loaded


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses of the joints at N samples."""

    rotation: Array  # (N, n, 3, 3)
    origin: Array  # (N, n, 3) m
    axis: Array  # axes of the joints in the base frame, (N, n, 3)
    slides: NDArray[np.bool_]  # joints that slide, (n,)
    movers: NDArray[np.bool_]  # movers[i, j] where joint j moves link i, (n, n)

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

    def moved_by(self, joint: int) -> NDArray[np.bool_]:
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


@dataclass(frozen=True, slots=True)
class CarriedClearance(Clearance):
    """Distances of a box in the hand from the capsules of other links."""

    kind: ClassVar[str] = "self-collision"
    lib: Library
    margin: float
    link: int
    box: CarriedBox
    proxies: tuple[ProxyFacts, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """The body and the capsule of every row."""
        return tuple(f"{LABEL} and {proxy.name}" for proxy in self.proxies)

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distance of the box from every capsule, (N, R) m, and its slopes by q, (N, R, n)."""
        poses = Poses.at(self.lib, q)
        # Frame of the box in the base frame.
        axes = poses.rotation[:, self.link] @ np.array(self.box.rotation)
        center = poses.placed(self.link, np.array(self.box.center))
        half = np.array(self.box.size) / 2
        carried = poses.moved_by(self.link)
        distances, slopes = [], []
        for proxy in self.proxies:
            ends = [poses.placed(proxy.joint, np.array(p)) for p in (proxy.start, proxy.end)]
            first, last = (np.einsum("tji,tj->ti", axes, end - center) for end in ends)
            point, way = closest(first, last - first, half)
            length = np.linalg.norm(way, axis=1)
            # Inside the box there is no direction: no slope, and the value is −radius.
            unit = way / np.where(length > _INSIDE, length, np.inf)[:, None]
            normal = np.einsum("tij,tj->ti", axes, unit)
            place = np.einsum("tij,tj->ti", axes, point) + center
            # Joints that move both or neither leave the distance; the line P Q has one moment.
            sign = poses.moved_by(proxy.joint).astype(float) - carried
            distances.append(length - proxy.radius)
            slopes.append(sign * poses.slopes(place, normal))
        return np.stack(distances, axis=1), np.stack(slopes, axis=1)

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""
        box = _body_of(self.link, self.box)
        others = (bounds.approach(box, body_of(proxy)) for proxy in self.proxies)
        return np.stack(list(others), axis=1)


@dataclass(frozen=True, slots=True)
class CarriedHeight(Clearance):
    """Height of the lowest corner of a box in the hand above a horizontal plane."""

    kind: ClassVar[str] = "table"
    labels: ClassVar[tuple[str, ...]] = (LABEL,)
    lib: Library
    margin: float
    link: int
    box: CarriedBox
    height: float

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Height of the lowest corner, (N, 1) m, and its slopes by q, (N, 1, n)."""
        poses = Poses.at(self.lib, q)
        axes = poses.rotation[:, self.link] @ np.array(self.box.rotation)
        center = poses.placed(self.link, np.array(self.box.center))
        # Of every edge the end that lies lower.
        corner = -np.where(axes[:, 2] < 0, -1.0, 1.0) * np.array(self.box.size) / 2
        lowest = center + np.einsum("tij,tj->ti", axes, corner)
        up = np.broadcast_to([0.0, 0.0, 1.0], lowest.shape)
        slope = poses.slopes(lowest, up) * poses.moved_by(self.link)
        return lowest[:, 2:] - self.height, slope[:, None]

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bound of the rate of the height, (K, 1) m/s."""
        return bounds.approach(_body_of(self.link, self.box))[:, None]


def _body_of(link: int, box: CarriedBox) -> Body:
    """The box as a body: no corner is farther than its centre and half a diagonal."""
    return Body(link, float(np.linalg.norm(box.center) + np.linalg.norm(box.size) / 2))


OBSTACLE = "obstacle"
"""Kind of the limit in certificates."""
LARGEST_LENGTH = 100.0
"""Largest coordinate, edge or radius [m]."""


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A box grown by a radius, fixed in the base frame; picklable."""

    name: str  # in certificates
    center: tuple[float, ...]  # (3,) m
    size: tuple[float, ...] = (0.0, 0.0, 0.0)  # lengths of the edges, (3,) m; zeros are a sphere
    # roll, pitch, yaw of the box, Rz(yaw) Ry(pitch) Rx(roll), rad
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    radius: float = 0.0  # of the rounding, m

    def __post_init__(self) -> None:
        vectors = self.center, self.size, self.rpy
        numbers = np.array([x for vector in vectors for x in vector] + [self.radius])
        shaped = all(len(vector) == 3 for vector in vectors)
        if not (
            shaped and np.isfinite(numbers).all() and (np.abs(numbers) <= LARGEST_LENGTH).all()
        ):
            raise IdentificationError(
                f"the obstacle '{self.name}' needs center, size and rpy of three finite numbers "
                f"and a radius, up to {LARGEST_LENGTH:g} m; correct them"
            )
        if min(*self.size, self.radius) < 0 or max(*self.size, self.radius) == 0:
            raise IdentificationError(
                f"the obstacle '{self.name}' needs edges and a radius from 0 m up of which one is "
                "above 0 m; correct size or radius"
            )

    @property
    def rotation(self) -> Array:
        """Axes of the box in the base frame, columns of (3, 3)."""
        return np.asarray(Rotation.from_euler("xyz", self.rpy).as_matrix())


class _Entry(Record, frozen=True, kw_only=True):
    """[[obstacle]]."""

    name: str = ""
    center: Vector3
    size: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    radius: float = 0.0


class _Cell(Record, frozen=True):
    """The file."""

    obstacle: Annotated[tuple[_Entry, ...], Meta(min_length=1)]


def read_obstacles(path: Path) -> tuple[Obstacle, ...]:
    """Read a file of obstacles.

    [[obstacle]]
    name = "post"
    center = [0.4, 0.3, 0.5]    # m in the base frame
    size = [0.1, 0.1, 1.0]      # m, edges; left out for a sphere
    rpy = [0.0, 0.0, 0.0]       # rad
    radius = 0.0                # m, rounding
    """
    cell = record_from_toml(_Cell, path, f"the obstacles '{path}'", IdentificationError)
    return tuple(
        Obstacle(**asdict(each.replace(name=each.name or f"{OBSTACLE} {k}")))
        for k, each in enumerate(cell.obstacle, 1)
    )


@dataclass(frozen=True, slots=True)
class ObstacleClearance(Clearance):
    """Distances of capsules from obstacles, the capsules of the first obstacle first."""

    kind: ClassVar[str] = OBSTACLE
    lib: Library
    margin: float
    obstacles: tuple[Obstacle, ...]
    proxies: tuple[ProxyFacts, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Capsule and obstacle of every row."""
        return tuple(f"{p.name} and {o.name}" for o in self.obstacles for p in self.proxies)

    def distances(self, motion: Array) -> Array:
        """Distance of every row, (N, R) m, without slopes."""
        return np.stack([one for one, _, _ in self._nearest(Poses.at(self.lib, motion[0]))], axis=1)

    def distances_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """Distance of every row, (N, R) m, and its slopes by q, (N, R, n)."""
        poses = Poses.at(self.lib, q)
        rows = list(self._nearest(poses))
        moving = [poses.moved_by(proxy.joint) for _ in self.obstacles for proxy in self.proxies]
        slopes = [
            poses.slopes(place, normal) * moved
            for (_, place, normal), moved in zip(rows, moving, strict=True)
        ]
        return np.stack([one for one, _, _ in rows], axis=1), np.stack(slopes, axis=1)

    def _nearest(self, poses: Poses) -> Iterator[tuple[Array, Array, Array]]:
        """Per row the distance (N,), the point of the axis and the direction from the obstacle."""
        axes = [
            np.stack([poses.placed(p.joint, np.array(end)) for end in (p.start, p.end)], axis=1)
            for p in self.proxies
        ]
        # Ends of all axes, one capsule after another: (R N, 2, 3).
        ends, count = np.concatenate(axes), len(axes[0])
        for obstacle in self.obstacles:
            turn, center = obstacle.rotation, np.array(obstacle.center)
            local = (ends - center) @ turn
            half = np.array(obstacle.size) / 2
            point, way = closest(local[:, 0], local[:, 1] - local[:, 0], half)
            length = np.linalg.norm(way, axis=1)
            # An axis inside the box has no direction: no slope, and the value is −radius.
            normal = way / np.where(length > 0, length, np.inf)[:, None] @ turn.T
            place = point @ turn.T + center
            for k, proxy in enumerate(self.proxies):
                rows = slice(k * count, (k + 1) * count)
                gap = length[rows] - proxy.radius - obstacle.radius
                yield gap, place[rows], normal[rows]

    def approaches(self, bounds: IntervalBounds) -> Array:
        """Bounds of the rates of the distances, (K, R) m/s."""
        speeds = np.stack([bounds.approach(body_of(proxy)) for proxy in self.proxies], axis=1)
        return np.tile(speeds, len(self.obstacles))


def capsule_around(box: CarriedBox, link: int) -> ProxyFacts:
    """Capsule that contains a carried box, with its axis parallel to the longest edge."""
    size, turn = np.array(box.size), np.array(box.rotation)
    longest = int(np.argmax(size))
    radius = float(np.hypot(*np.delete(size, longest))) / 2
    half = turn[:, longest] * size[longest] / 2
    first, last = (tuple((np.array(box.center) + s * half).tolist()) for s in (-1, 1))
    return ProxyFacts(LABEL, LABEL, link, first, last, radius)
