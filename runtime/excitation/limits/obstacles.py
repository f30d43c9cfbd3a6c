"""Obstacles fixed in the base frame: their distances from the links of a robot, with exact slopes.

An obstacle is a box grown by a radius, which includes spheres (no edges) and capsules (one edge).
The distance of a link is that of the axis of its capsule from the box, less both radii. A carried
box counts as the capsule around it: its axis is parallel to the longest edge.

    g = (margin − distance) / 0.1 m       one row per obstacle and capsule
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
from runtime.excitation.limits.carried_body import LABEL, CarriedBox, Poses, closest
from runtime.excitation.limits.distance_limits import Clearance, body_of
from runtime.excitation.limits.nonlinear_limits import IntervalBounds
from runtime.library import Array, Library, ProxyFacts

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
