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
from scipy.spatial.transform import Rotation

from runtime.common.records import Record, Vector3, record_from_toml
from runtime.errors import IdentificationError
from runtime.excitation.limits.distance_limits import Clearance, body_of
from runtime.excitation.limits.nonlinear_limits import Body, IntervalBounds
from runtime.library import Array, Library, Mask, ProxyFacts
from runtime.library.parameters import link_columns

EMPTY_HAND = "empty hand"  # what a certificate states of the load where no body is carried
LABEL = "carried body"
_INSIDE = 1e-12  # distance of an axis from the box, m, without a direction: it is inside


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

    def placed(self, link: int) -> "PlacedBox":
        """The box in its link."""
        return PlacedBox(
            link, np.array(self.center), np.array(self.rotation), np.array(self.size) / 2
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


OBSTACLE = "obstacle"  # kind of the limit in certificates
LARGEST_LENGTH = 100.0  # largest coordinate, edge or radius [m]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A box grown by a radius, fixed in the base frame; picklable."""

    name: str  # in certificates
    center: tuple[float, ...]  # (3,) m
    size: tuple[float, ...] = (0.0, 0.0, 0.0)  # lengths of the edges, (3,) m; zeros are a sphere
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)  # Rz(yaw) Ry(pitch) Rx(roll) of the box, rad
    radius: float = 0.0  # of the rounding, m

    def __post_init__(self) -> None:
        vectors = self.center, self.size, self.rpy
        numbers = np.array([x for vector in vectors for x in vector] + [self.radius])
        shaped = all(len(vector) == 3 for vector in vectors)
        if not (shaped and (np.abs(numbers) <= LARGEST_LENGTH).all()):  # false for NaN, too
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
    def placed(self) -> "PlacedBox":
        """The box in the base frame."""
        turn = np.asarray(Rotation.from_euler("xyz", self.rpy).as_matrix())
        center, half = np.array(self.center), np.array(self.size) / 2
        return PlacedBox(-1, center, turn, half, self.radius)


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
