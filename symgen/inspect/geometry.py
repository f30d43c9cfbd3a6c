"""Volume and extent of a link's shapes: primitives in closed form, meshes by their convex hull.

The volume of the hull is at least that of the part, watertight or not. Overlapping shapes count
twice, so the density is approximate. Assimp, with which coal loads meshes, reads a list of indices
of a COLLADA file until it has as many numbers as the file announces; a character that is not a
digit stops its position, but not its loop: such files are refused before (`is_sound`).

Links that are fixed to each other are one body; motion and simulators depend on their sum only:
P = Σ_k T_k P_k T_kᵀ,  T_k from the frame of link k to that of the heaviest one.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import ParseError

import coal
import numpy as np
from defusedxml.ElementTree import iterparse
from scipy.spatial import ConvexHull, QhullError

from runtime.common.packages import folders_of_package
from symgen.inspect.model import Body, Link, Model, Shape
from symgen.kernel import Array

LARGEST_MESH = 200 * 2**20  # largest size of a mesh file that is read, bytes
_ROUND = 32  # points on a circle
INDICES = frozenset({"p", "ph", "h", "v", "vcount"})  # elements that hold integers
FLOATS = frozenset({"float_array", "matrix", "translate", "rotate", "scale", "lookat", "skew"})
"""Elements that hold floating-point numbers."""
DEEPEST = 200  # largest depth of elements; exporters write about ten levels


@dataclass(frozen=True, slots=True, eq=False)
class Extent:
    """Space that a link occupies."""

    volume: float  # m³
    points: Array  # (N, 3) points that span its shapes, m

    def reach(self, centre: Array) -> float:
        """Largest distance of a point from a centre, m."""
        return float(np.linalg.norm(self.points - centre, axis=1).max())


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """A body of links that are fixed to each other, in the frame of its heaviest link."""

    where: str  # place for findings
    body: Body  # sum of the consistent bodies
    extent: Extent | None  # of the shapes of all links; None where one is unknown, or without any
    reach: float  # largest distance from the frame to the joints of the group and its centre, m


class Meshes:
    """Search and measurement of the mesh files of a model file."""

    def __init__(self, model_file: Path, packages: tuple[Path, ...] = ()) -> None:
        self._folder = model_file.resolve().parent
        self._packages = packages
        self._cache: dict[tuple[str, tuple[float, ...]], Array | None] = {}
        self.missing: list[str] = []  # names of files that were not found or are not solids

    def extent(self, link: Link) -> Extent | None:
        """Extent of the collision shapes of a link, else of its visual shapes; None if unknown."""
        for is_collision in (True, False):
            shapes = [s for s in link.shapes if s.is_collision == is_collision]
            parts = [self._part(shape) for shape in shapes]
            if parts and all(part is not None for part in parts):
                measured = [part for part in parts if part is not None]
                volume = sum(v for v, _ in measured)
                if volume > 0:
                    return Extent(volume, np.vstack([p for _, p in measured]))
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
        return None if corners is None else (float(ConvexHull(corners).volume), corners)

    def _find(self, file: str) -> Path | None:
        if file.startswith(("package://", "model://")):
            tail = file.split("://", 1)[1]
            package, _, rest = tail.partition("/")
            above = (self._folder, *self._folder.parents)
            places = chain(
                (folder / rest for folder in folders_of_package(package, self._packages)),
                (root / tail for root in above),
                (root / rest for root in above if root.name == package),
            )
        else:
            places = chain([self._folder / file.removeprefix("file://")])
        for place in places:
            try:
                if place.is_file() and 0 < place.stat().st_size < LARGEST_MESH:
                    return place
            except (OSError, ValueError):  # a name with a NUL, or a folder without permission
                continue
        return None


def _corners(path: Path, scale: tuple[float, ...]) -> Array | None:
    """Vertices of the convex hull, or None for a mesh that is not a solid."""
    if path.suffix.lower() == ".dae" and not is_sound(path):
        return None
    try:
        vertices = np.array(coal.MeshLoader().load(str(path), np.array(scale)).vertices())
        return vertices[ConvexHull(vertices).vertices]
    except (ValueError, RuntimeError, QhullError):
        return None


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


def is_sound(path: Path) -> bool:
    """True for a .dae file of well-formed XML and moderate depth whose lists hold only numbers."""
    depth = 0
    try:
        for event, element in iterparse(path, events=("start", "end"), forbid_dtd=True):
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                return False
            if event == "end":
                _require_numbers(str(element.tag).rpartition("}")[2], element.text or "")
    except (ParseError, ValueError, OSError):
        return False
    return True


def _require_numbers(tag: str, text: str) -> None:
    if tag in INDICES and not all(word.isdecimal() and word.isascii() for word in text.split()):
        raise ValueError(tag)
    if tag in FLOATS:
        for word in text.split():
            float(word)


def groups_of(model: Model, extents: dict[str, Extent | None]) -> Iterator[Group]:
    """Return the groups that have a consistent body."""
    grouped: set[str] = set()
    for name in model.links:
        joint = model.joint_of(name)
        if joint is None or joint.moves or joint.parent not in model.links:
            poses = {x: pose for x, pose in model.poses(name).items() if x not in grouped}
            grouped.update(poses)
            yield from _group(model, poses, extents)


def _group(model: Model, poses: dict[str, Array], extents: dict[str, Extent | None]) -> list[Group]:
    known = model.bodies
    bodies = {x: known[x] for x in poses if x in known and known[x].is_realisable}
    if not bodies:
        return []
    root, heaviest = next(iter(poses)), max(bodies, key=lambda name: bodies[name].mass)
    back = np.linalg.inv(poses[heaviest])
    poses = {name: back @ pose for name, pose in poses.items()} | {heaviest: np.eye(4)}
    where, whole = f"link '{heaviest}'", bodies[heaviest]  # one alone keeps its numbers
    if len(bodies) > 1:
        where += f" with what is fixed to it ({len(bodies) - 1} more)"
        parts = [poses[x] @ body.pseudo_inertia @ poses[x].T for x, body in bodies.items()]
        whole = Body.of(np.sum(parts, axis=0))
    return [Group(where, whole, _extent(model, poses, extents), _reach(model, root, poses, bodies))]


def _extent(
    model: Model, poses: dict[str, Array], extents: dict[str, Extent | None]
) -> Extent | None:
    volume, points = 0.0, []
    for name, pose in poses.items():
        extent = extents[name]
        if extent is not None:
            volume += extent.volume
            points.append(extent.points @ pose[:3, :3].T + pose[:3, 3])
        elif model.links[name].shapes:
            return None
    return Extent(volume, np.vstack(points)) if points else None


def _reach(model: Model, root: str, poses: dict[str, Array], bodies: dict[str, Body]) -> float:
    carrier = model.joint_of(root)
    offsets = [pose[:3, 3] for pose in poses.values()]
    offsets += [] if carrier is None else [carrier.offset]
    for name, pose in poses.items():
        ends = [child.offset for child in model.children(name)]
        ends += [bodies[name].com] if name in bodies else []
        offsets += [pose[:3, :3] @ end + pose[:3, 3] for end in ends]
    return max(math.hypot(*offset) for offset in offsets)  # without overflow
