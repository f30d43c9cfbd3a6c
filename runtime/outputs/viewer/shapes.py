"""Shapes of a robot: its visual meshes, else its collision capsules, else solids of its joints.

Meshes of `package://` are searched by `common.packages`. A link that is fixed to a moving link is
drawn with it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from defusedxml.ElementTree import ParseError, fromstring
from scipy.spatial.transform import Rotation

from runtime.common.files import text_of
from runtime.common.optional import optional
from runtime.common.packages import folders_of_package
from runtime.errors import LibraryError, RuntimeFault
from runtime.library import Array, Library

BASE = "base"
SLENDER = 25.0  # length of all links over the radius of one without shape, as of usual arms
WIDER = 1.3  # radius of a joint over that of the link
LARGEST_COORDINATE = 1e4  # largest coordinate that is accepted [m]
COLOURS = ((96, 125, 160, 255), (170, 185, 205, 255))  # RGBA colours of links without one, in turn


@dataclass(frozen=True, slots=True)
class Shape:
    """A mesh with its pose (4, 4) in the frame of `link`; BASE is the fixed link."""

    link: str
    name: str
    mesh: Any
    pose: Array


@dataclass(frozen=True, slots=True)
class Look:
    """Shapes of a robot, and a sentence on their origin."""

    shapes: tuple[Shape, ...]
    sentence: str


def geometry_library() -> Any:
    """Import trimesh, which viser depends on."""
    return optional("trimesh", "the viewer", "view")


def look_of(lib: Library, urdf: Path | None = None, packages: Iterable[Path] = ()) -> Look:
    """Shapes of a robot: visuals of the URDF, else collision capsules, else solids."""
    text = lib.urdf() if urdf is None else _text(urdf)
    home = lib.folder if urdf is None else urdf.parent
    places = tuple(packages)
    try:
        visuals = tuple(_visuals(fromstring(text, forbid_dtd=True), lib))
    except (ParseError, ValueError) as error:
        raise LibraryError(
            f"'{urdf or lib.name}' is not a URDF ({error}); give the robot model"
        ) from None
    shapes: list[Shape] = []
    missing: list[str] = []
    for link, pose, visual in visuals:
        try:
            shapes.append(_shape(link, len(shapes), pose, visual, places, home))
        except RuntimeFault:
            raise
        except Exception as error:  # trimesh and its loaders raise any exception
            mesh = visual.find("geometry/mesh")
            name = visual.get("name", "a visual") if mesh is None else mesh.get("filename")
            missing.append(f"{name} ({str(error) or type(error).__name__})")
    if shapes:
        rest = f"; not drawn: {', '.join(missing)}" if missing else ""
        return Look(tuple(shapes), f"{len(shapes)} visual shapes{rest}")
    why = f"no mesh could be read: {missing[0]}" if missing else "the URDF has no visual shapes"
    if lib.manifest.proxies:
        capsules = (
            _capsule(p.link, p.name, np.array([p.start, p.end]), p.radius, p.joint)
            for p in lib.manifest.proxies
        )
        return Look(tuple(capsules), f"collision capsules, because {why}")
    return Look(tuple(_solids(lib)), f"solids between the joints, because {why}")


def _text(path: Path) -> str:
    try:
        return text_of(path)
    except (OSError, ValueError) as error:
        raise LibraryError(f"cannot read '{path}' ({error}); give a URDF") from None


# --- visuals of the URDF -----------------------------------------------------------------------


def _visuals(robot: Element, lib: Library) -> Iterator[tuple[str, Array, Element]]:
    """Yield the moving link, the pose of the visual in its frame, and the element."""
    above = {}
    for joint in robot.iter("joint"):
        child = joint.find("child")
        if child is not None:
            above[child.get("link")] = joint
    for link in robot.iter("link"):
        carrier = _carrier(str(link.get("name")), above, lib)
        if carrier is not None:
            for visual in link.findall("visual"):
                yield carrier[0], carrier[1] @ _pose(visual.find("origin")), visual


def _carrier(link: str, above: dict[Any, Element], lib: Library) -> tuple[str, Array] | None:
    """The moving link, or BASE, that a link is fixed to, and the pose of the link in it."""
    pose, seen = np.eye(4), {""}
    while link not in lib.link_names:
        if link == lib.manifest.base:
            return BASE, pose
        joint = above.get(link)
        if link in seen or joint is None or joint.get("type") != "fixed":
            return None
        seen.add(link)
        pose = _pose(joint.find("origin")) @ pose
        parent = joint.find("parent")
        link = "" if parent is None else str(parent.get("link"))
    return link, pose


def _pose(origin: Element | None) -> Array:
    pose = np.eye(4)
    if origin is not None:
        pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"), 3)
        turns = _numbers(origin.get("rpy", "0 0 0"), 3)
        pose[:3, :3] = Rotation.from_euler("xyz", turns).as_matrix()
    return pose


def _numbers(text: str, count: int) -> list[float]:
    values = [float(word) for word in text.split()]
    if len(values) != count or not np.abs(values).max() < LARGEST_COORDINATE:
        raise ValueError(f"expected {count} numbers below {LARGEST_COORDINATE:g}, got '{text}'")
    return values


def _shape(
    link: str, number: int, pose: Array, visual: Element, places: Iterable[Path], home: Path
) -> Shape:
    geometry = visual.find("geometry")
    kind = next(iter(geometry), None) if geometry is not None else None
    if kind is None:
        raise ValueError("no geometry")
    trimesh = geometry_library()
    if kind.tag == "mesh":
        mesh = trimesh.load(_resolved(str(kind.get("filename")), places, home), force="scene")
        pose = pose @ np.diag([*_numbers(kind.get("scale", "1 1 1"), 3), 1.0])
        return Shape(link, f"visual{number}", mesh, pose)
    mesh = {
        "box": lambda: trimesh.creation.box(_numbers(kind.get("size", ""), 3)),
        "sphere": lambda: trimesh.creation.icosphere(3, *_numbers(kind.get("radius", ""), 1)),
        "cylinder": lambda: trimesh.creation.cylinder(
            *_numbers(kind.get("radius", ""), 1), *_numbers(kind.get("length", ""), 1)
        ),
    }[kind.tag]()
    mesh.visual.face_colors = COLOURS[number % len(COLOURS)]
    return Shape(link, f"visual{number}", mesh, pose)


def _resolved(name: str, places: Iterable[Path], home: Path) -> Path:
    scheme, _, rest = name.rpartition("://")
    candidates = iter([home / rest])
    if scheme in {"package", "model"}:
        package, _, inner = rest.partition("/")
        candidates = (folder / inner for folder in folders_of_package(package, places))
    for path in candidates:
        if path.is_file():
            return path
    raise FileNotFoundError("not found; name the folder of its package with --package-dir")


# --- without visuals ------------------------------------------------------------------------------


def _solids(lib: Library) -> Iterator[Shape]:
    """Capsules from the frame of every link to its children and the tip, cylinders at joints."""
    carried: list[tuple[str, Array, int]] = [
        (BASE if j.parent < 0 else lib.link_names[j.parent], np.array(j.translation), k)
        for k, j in enumerate(lib.manifest.all_joints)
    ]
    tip = lib.manifest.tip_frame
    carried.append((tip.link, np.array(tip.translation), lib.n_links))
    radius = sum(float(np.linalg.norm(end)) for _, end, _ in carried) / SLENDER or 1.0 / SLENDER
    for link, end, number in carried:
        yield _capsule(link, f"link{number}", np.array([np.zeros(3), end]), radius, number)
    moved = zip(lib.link_names, lib.manifest.all_joints, strict=True)
    for number, (link, joint) in enumerate(moved):
        mesh = geometry_library().creation.cylinder(WIDER * radius, 2 * WIDER * radius)
        yield _along(link, f"joint{number}", mesh, np.array(joint.axis), np.zeros(3), number)


def _capsule(link: str, name: str, ends: Array, radius: float, number: int) -> Shape:
    trimesh = geometry_library()
    axis = ends[1] - ends[0]
    mesh = trimesh.creation.capsule(float(np.linalg.norm(axis)), radius)
    return _along(link, name, mesh, axis, ends.mean(axis=0), number)


def _along(link: str, name: str, mesh: Any, axis: Array, centre: Array, number: int) -> Shape:
    """A mesh about its centre whose z axis points along `axis`; a zero axis turns nothing."""
    mesh.visual.face_colors = COLOURS[number % len(COLOURS)]
    pose, length = np.eye(4), float(np.linalg.norm(axis))
    if length > 0:
        pose[:3, :3] = Rotation.align_vectors([axis / length], [[0, 0, 1]])[0].as_matrix()
    pose[:3, 3] = centre
    return Shape(link, name, mesh, pose)
