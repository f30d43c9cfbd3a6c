"""Volume and extent of a link's shapes: primitives in closed form, meshes by their convex hull.

Meshes are searched outside the folder of the model too, since packages keep theirs elsewhere; only
their shape is reported.

The volume of the hull is at least that of the part, watertight or not. coal (in the `pin` wheel)
loads STL, DAE and OBJ. Overlapping shapes count twice, so the density is approximate.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symgen.inspect.collada import is_sound
from symgen.inspect.model import Array, Link, Shape

LARGEST_MESH = 200 * 2**20
"""Largest size of a mesh file that is read, bytes."""
_ROUND = 32
"""Points on a circle."""


@dataclass(frozen=True, slots=True, eq=False)
class Extent:
    """Space that a link occupies.

    Attributes:
        volume: m³.
        points: (N, 3) points that span its shapes, m.
    """

    volume: float
    points: Array

    def reach(self, centre: Array) -> float:
        """Largest distance of a point from a centre, m."""
        return float(np.linalg.norm(self.points - centre, axis=1).max())


class Meshes:
    """Search and measurement of the mesh files of a model file.

    Attributes:
        missing: file names that were not found or are not solids.
    """

    def __init__(self, model_file: Path, packages: tuple[Path, ...] = ()) -> None:
        self._folder = model_file.resolve().parent
        variables = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
        listed = [Path(p) for v in variables for p in os.environ.get(v, "").split(":") if p]
        shares = [p / "share" for p in listed]
        self._roots = (*packages, *listed, *shares, self._folder, *self._folder.parents)
        self._cache: dict[tuple[str, tuple[float, ...]], Array | None] = {}
        self.missing: list[str] = []

    def extent(self, link: Link) -> Extent | None:
        """Extent of the collision shapes of a link, else of its visual shapes; None if unknown."""
        for is_collision in (True, False):
            shapes = [s for s in link.shapes if s.is_collision == is_collision]
            parts = [self._part(shape) for shape in shapes]
            if parts and all(part is not None for part in parts):
                known = [part for part in parts if part is not None]
                volume = sum(v for v, _ in known)
                if volume > 0:
                    return Extent(volume, np.vstack([p for _, p in known]))
        return None

    def _part(self, shape: Shape) -> tuple[float, Array] | None:
        measured = self._mesh(shape) if shape.kind == "mesh" else _primitive(shape)
        if measured is None:
            return None
        volume, points = measured
        return volume, points @ shape.rotation.T + shape.translation

    def _mesh(self, shape: Shape) -> tuple[float, Array] | None:
        key = (shape.file, shape.size)
        if key not in self._cache:
            path = self._find(shape.file)
            self._cache[key] = None if path is None else _corners(path, shape.size)
            if self._cache[key] is None:
                self.missing.append(shape.file)
        corners = self._cache[key]
        return None if corners is None else (_hull_volume(corners), corners)

    def _find(self, file: str) -> Path | None:
        if file.startswith(("package://", "model://")):
            tail = file.split("://", 1)[1]
            package, _, rest = tail.partition("/")
            places = [root / tail for root in self._roots]
            places += [root / rest for root in self._roots if root.name == package]
        else:
            places = [self._folder / file.removeprefix("file://")]
        for place in places:
            try:
                if place.is_file() and 0 < place.stat().st_size < LARGEST_MESH:
                    return place
            except (OSError, ValueError):  # a name with a NUL, or a folder without permission
                continue
        return None


def _corners(path: Path, scale: tuple[float, ...]) -> Array | None:
    """Vertices of the convex hull, or None for a mesh that is not a solid."""
    import coal
    from scipy.spatial import ConvexHull, QhullError

    if path.suffix.lower() == ".dae" and not is_sound(path):
        return None
    try:
        vertices = np.array(coal.MeshLoader().load(str(path), np.array(scale)).vertices())
        return vertices[ConvexHull(vertices).vertices]
    except (ValueError, RuntimeError, QhullError):
        return None


def _hull_volume(corners: Array) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(corners).volume)


def _primitive(shape: Shape) -> tuple[float, Array] | None:
    if not all(x > 0 for x in shape.size):
        return None
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    if shape.kind == "box":
        return float(np.prod(shape.size)), signs * np.array(shape.size) / 2
    radius = shape.size[0]
    if shape.kind == "sphere":
        directions = np.vstack([np.eye(3), -np.eye(3), signs / np.sqrt(3)])
        return 4 / 3 * np.pi * radius**3, radius * directions
    length = shape.size[1]
    angle = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle])
    up = np.array([0.0, 0.0, length / 2])
    ends = np.vstack([ring - up, ring + up])
    volume = np.pi * radius**2 * length
    if shape.kind == "capsule":
        volume += 4 / 3 * np.pi * radius**3
        ends = np.vstack([ends, [[0, 0, z * (length / 2 + radius)] for z in (-1, 1)]])
    return float(volume), ends
