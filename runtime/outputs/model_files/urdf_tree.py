"""The URDF that the kernels describe, as a tree of links with their placements.

Reads what `symgen build` normalised: revolute, continuous, prismatic and fixed joints, one root.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring
from scipy.spatial.transform import Rotation

from runtime.errors import ExportError
from runtime.library import Array, Library
from runtime.outputs.model_files.bodies import Body

WORLD = "world"
"""A root link of this name is what MuJoCo and SDF have already."""


@dataclass(frozen=True, slots=True)
class Edge:
    """A joint of the URDF, fixed ones included.

    Attributes:
        placement: T from the frame of the child (at q = 0) to that of the parent, (4, 4).
        axis: unit vector in the frame of the child, (3,).
        lower, upper: rad or m, None without limit.
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: Array
    axis: Array
    lower: float | None
    upper: float | None


@dataclass(frozen=True, slots=True)
class Tree:
    """A URDF document; `root` may be changed, it is nobody else's."""

    name: str
    root: Element
    links: dict[str, Element]
    edges: dict[str, Edge]
    base: str
    moving: tuple[str, ...]

    def carrier(self, link: str) -> tuple[str | None, Array]:
        """The moving link that a link is rigidly part of, and T from the one frame to the other.

        None for what is fixed to the base, with T to the base.
        """
        T = np.eye(4)
        while link not in self.moving and link in self.edges:
            T = self.edges[link].placement @ T
            link = self.edges[link].parent
        return (link if link in self.moving else None), T

    def published(self, link: str) -> Body | None:
        """The body that the document gives a link; None without an <inertial>."""
        inertial = self.links[link].find("inertial")
        if inertial is None:
            return None
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        T = _placement(inertial, f"link '{link}'")
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        xx, xy, xz, yy, yz, zz = (
            0.0 if inertia is None else number(inertia.get(key, "0"), f"link '{link}': {key}")
            for key in keys
        )
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        value = "0" if mass is None else mass.get("value", "0")
        return Body(number(value, f"link '{link}': mass"), T[:3, 3], T[:3, :3] @ own @ T[:3, :3].T)

    def children(self, link: str) -> list[Edge]:
        """Joints below a link: moving ones in the order of the library, then fixed ones."""
        found = [edge for edge in self.edges.values() if edge.parent == link]
        return sorted(found, key=lambda edge: self._rank(edge.child))

    def _rank(self, link: str) -> int:
        """Index of the first joint at or below a link."""
        below = [self.moving.index(x) for x in self.subtree(link) if x in self.moving]
        return min(below, default=len(self.moving))

    def subtree(self, link: str) -> Iterator[str]:
        """A link and everything that hangs on it."""
        yield link
        for edge in self.edges.values():
            if edge.parent == link:
                yield from self.subtree(edge.child)


def read_tree(lib: Library, text: str | None = None) -> Tree:
    """The URDF of a library, or another text of the same robot.

    Raises:
        ExportError: it is damaged or lacks a link; run symgen build.
    """
    root = _parse(lib, lib.urdf() if text is None else text)
    links = {link.get("name", ""): link for link in root.findall("link")}
    missing = sorted(set(lib.link_names) - set(links))
    if missing:
        raise ExportError(
            f"the URDF of '{lib.name}' lacks the link '{missing[0]}'; run: python -m symgen build"
        )
    edges = {edge.child: edge for edge in map(_edge, root.findall("joint"))}
    joints = {edges[link].name for link in lib.link_names if link in edges}
    if joints != set(lib.joint_names):
        raise ExportError(
            f"the URDF of '{lib.name}' has the joints {', '.join(sorted(joints))}, the library "
            f"{', '.join(sorted(lib.joint_names))}; run: python -m symgen build"
        )
    roots = [link for link in links if link not in edges]
    tree = Tree(root.get("name") or lib.name, root, links, edges, (*roots, "")[0], lib.link_names)
    # What hangs on a loop or on no link is not below the root.
    if len(roots) != 1 or set(tree.subtree(roots[0])) != set(links):
        raise ExportError(
            f"the URDF of '{lib.name}' is no tree of links (its roots are "
            f"{', '.join(roots) or 'none'}); run: python -m symgen build"
        )
    return tree


def _parse(lib: Library, text: str) -> Element:
    try:
        root: Element = fromstring(text, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise ExportError(
            f"the URDF of '{lib.name}' is damaged ({error}); run: python -m symgen build"
        ) from None
    return root


def _edge(joint: Element) -> Edge:
    name, kind = joint.get("name", ""), joint.get("type", "")
    ends = [joint.find(tag) for tag in ("parent", "child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    node, limit = joint.find("axis"), joint.find("limit")
    text = "1 0 0" if node is None else node.get("xyz", "1 0 0")
    axis = _numbers(text, f"joint '{name}': axis")
    bounded = limit is not None and kind in {"revolute", "prismatic"}
    # A <limit> without lower and upper is one of effort and velocity alone.
    found = [
        number(limit.get(key, ""), f"joint '{name}': {key}")
        if bounded and limit is not None and key in limit.attrib
        else None
        for key in ("lower", "upper")
    ]
    return Edge(
        name,
        kind,
        parent,
        child,
        _placement(joint, f"joint '{name}'"),
        axis / (float(np.linalg.norm(axis)) or 1.0),
        *found,
    )


def _placement(element: Element, owner: str) -> Array:
    node, T = element.find("origin"), np.eye(4)
    if node is not None:
        rpy = _numbers(node.get("rpy", "0 0 0"), f"{owner}: rpy")
        T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
        T[:3, 3] = _numbers(node.get("xyz", "0 0 0"), f"{owner}: xyz")
    return T


def _numbers(text: str, what: str) -> Array:
    words = text.split()
    if len(words) != 3:
        raise ExportError(f"{what} of the URDF needs three numbers, got '{text}'; build it again")
    return np.array([number(word, what) for word in words])


def number(text: str, what: str) -> float:
    """A number of the URDF; ExportError where it is none."""
    try:
        return float(text)
    except ValueError:
        raise ExportError(f"{what} of the URDF needs a number, got '{text}'; build again") from None
