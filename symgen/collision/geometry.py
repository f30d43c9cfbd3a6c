"""Collision geometry of a URDF as triangles and round shapes in the frames of the chain's links.

Pinocchio reads the URDF and its meshes through coal. Triangles are cut until their edges are short,
so that each lies as a whole in one convex proxy: a triangle is inside a capsule if its corners are.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio
from scipy.spatial import ConvexHull

from symgen.chain import Chain
from symgen.collision.model import BASE
from symgen.errors import CollisionError
from symgen.kernel import Array

FARTHEST = 10.0  # largest coordinate of a shape in its link's frame, m; beyond it a mesh is in mm
EDGE = 0.02  # longest edge of a triangle after cutting, m
_CORNERS = 32  # corners of the polygon around a circle


@dataclass(frozen=True, slots=True)
class Capsule:
    """All points within `radius` of a segment; one of the URDF, or a sphere, needs no fit."""

    start: Array  # start, end: (3,) m, in the link's frame
    end: Array
    radius: float  # m

    @property
    def volume(self) -> float:
        """π r² L + 4/3 π r³, m³."""
        length = float(np.linalg.norm(self.end - self.start))
        return float(np.pi * self.radius**2 * (length + 4 / 3 * self.radius))


@dataclass(frozen=True, slots=True)
class LinkGeometry:
    """Shapes fixed in one link."""

    link: str  # moving link of the chain, or `BASE`
    triangles: Array  # (T, 3, 3) corners, m, in the link's frame; no edge is longer than `EDGE`
    rounds: tuple[Capsule, ...]  # spheres and capsules
    volume: float  # m³ of the convex hulls of the angular shapes


def read_geometry(chain: Chain, packages: list[Path]) -> tuple[LinkGeometry, ...]:
    """Collision geometry of all links of a chain that have any."""
    objects = _objects(chain, packages)
    links = []
    for joint, link in enumerate((BASE, *(j.link for j in chain.joints))):
        parts = [o for o in objects if o.parentJoint == joint]
        if parts:
            links.append(_link(link, parts))
    if not links:
        raise CollisionError(
            f"no link of '{chain.name}' has a <collision> shape, so there is nothing to enclose; "
            "use a URDF with collision geometry or write [[proxy]] tables by hand"
        )
    return tuple(links)


def _objects(chain: Chain, packages: list[Path]) -> list[Any]:
    try:
        model = pinocchio.buildModelFromXML(chain.urdf)
        kind = pinocchio.GeometryType.COLLISION
        folders = [str(folder.resolve()) for folder in packages]
        geometry = pinocchio.buildGeomFromUrdfString(model, chain.urdf, kind, package_dirs=folders)
    except (ValueError, RuntimeError) as error:
        raise CollisionError(
            f"the collision geometry of '{chain.name}' cannot be read "
            f"({' '.join(str(error).split())}); name the folders that hold its packages with "
            "--package-dir DIR"
        ) from None
    return list(geometry.geometryObjects)


def _link(link: str, parts: list[Any]) -> LinkGeometry:
    triangles, rounds, volume = [], [], 0.0
    for part in parts:
        shape, placement = part.geometry, part.placement
        if isinstance(shape, (coal.Sphere, coal.Capsule)):
            half = np.array([0.0, 0.0, getattr(shape, "halfLength", 0.0)])
            rounds.append(Capsule(placement.act(-half), placement.act(half), float(shape.radius)))
            continue
        corners = _corners(part.name, shape)
        corners = corners @ placement.rotation.T + placement.translation
        if not np.abs(corners).max() < FARTHEST:
            raise CollisionError(
                f"the collision shape '{part.name}' reaches {np.abs(corners).max():g} m, expected "
                f"less than {FARTHEST:g} m; shapes are in m, correct it or the scale of its mesh"
            )
        volume += float(ConvexHull(corners.reshape(-1, 3)).volume)
        triangles.append(cut(corners))
    joined = np.concatenate(triangles) if triangles else np.zeros((0, 3, 3))
    return LinkGeometry(link, joined, tuple(rounds), volume)


def _corners(name: str, shape: Any) -> Array:
    """Triangles (T, 3, 3) of a shape in its frame, or of a polytope around it."""
    if isinstance(shape, coal.Box):
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        return _hull(signs * np.asarray(shape.halfSide))
    if isinstance(shape, (coal.Cylinder, coal.Cone)):
        angle = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
        around = shape.radius / np.cos(np.pi / _CORNERS)  # the polygon goes around the circle
        circle = around * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        ends = [np.column_stack([circle, np.full(_CORNERS, z * shape.halfLength)]) for z in (-1, 1)]
        return _hull(np.concatenate(ends))
    if isinstance(shape, coal.BVHModelBase):
        vertices = np.asarray(shape.vertices())
        indices = [[t[0], t[1], t[2]] for t in map(shape.tri_indices, range(shape.num_tris))]
        if indices and np.isfinite(vertices).all():
            return vertices[np.array(indices)]
    raise CollisionError(
        f"the collision shape '{name}' ({type(shape).__name__}) is not a mesh with triangles, a "
        "box, cylinder, cone, sphere or capsule; replace it in the URDF"
    )


def _hull(points: Array) -> Array:
    return points[ConvexHull(points).simplices]


def cut(triangles: Array, edge: float = EDGE) -> Array:
    """Divide triangles until no edge is longer than `edge`: the longest edge is halved."""
    done = []
    while len(triangles):
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)  # (T, 3)
        longest = sides.argmax(axis=1)
        fine = sides.max(axis=1) <= edge
        done.append(triangles[fine])
        rest, first = triangles[~fine], longest[~fine]
        rows = np.arange(len(rest))
        a, b, c = (rest[rows, (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(done)
