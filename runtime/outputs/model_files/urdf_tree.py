"""The URDF of the kernels as a tree of links with their placements and bodies.

It was normalised by `symgen build`: revolute, continuous, prismatic and fixed joints, one root.

P = [[Σ, m c], [m cᵀ, m]],   Σ = Σ_com + m c cᵀ,   I_com = tr(Σ_com) 1 − Σ_com,   P' = T P Tᵀ

P is linear in the mass distribution: the pseudo-inertias of bodies that are fixed to each other
add up, and T = [[R, p], [0, 1]] transforms P to another frame. Source: Wensing, Kim & Slotine
2018.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import takewhile
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring
from scipy.spatial.transform import Rotation

from runtime.errors import ExportError
from runtime.library import Array, Library
from runtime.library.parameters import inertia_matrix


@dataclass(frozen=True, slots=True, eq=False)
class RigidBody:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg·m²], axes of the link."""

    mass: float
    com: Array
    inertia: Array

    @property
    def pseudo_inertia(self) -> Array:
        """Pseudo-inertia P (4, 4) about the origin of the link [kg·m², kg·m, kg]."""
        sigma = np.trace(self.inertia) / 2 * np.eye(3) - self.inertia
        P = np.empty((4, 4))
        P[:3, :3] = sigma + self.mass * np.outer(self.com, self.com)
        P[:3, 3] = P[3, :3] = self.mass * self.com
        P[3, 3] = self.mass
        return P

    def entries(self) -> dict[str, float]:
        """Upper triangle of the inertia by name: xx, xy, xz, yy, yz, zz [kg·m²]."""
        axes = {"x": 0, "y": 1, "z": 2}
        return {a + b: float(self.inertia[axes[a], axes[b]]) for a in axes for b in axes if a <= b}


def body_of(P: Array) -> RigidBody:
    """Rigid body of a pseudo-inertia P (4, 4) with non-zero mass."""
    mass = float(P[3, 3])
    com = P[:3, 3] / mass
    sigma = P[:3, :3] - mass * np.outer(com, com)
    return RigidBody(mass, com, np.trace(sigma) * np.eye(3) - sigma)


def smallest_eigenvalue(P: Array) -> float:
    """Smallest eigenvalue of P (4, 4) over its trace, or without one; ≥ 0 if consistent."""
    return float(np.linalg.eigvalsh(P)[0]) / (abs(float(np.trace(P))) or 1.0)


def quaternion(T: Array) -> Array:
    """Rotation of T (4, 4) as a unit quaternion w, x, y, z (4,)."""
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)
    return np.array([w, x, y, z])


def digits(value: float) -> str:
    """Shortest text that reads back as the same double, bit for bit."""
    return repr(float(value) + 0.0)  # + 0.0 turns −0 into 0


def row(values: Array) -> str:
    """Numbers separated by blanks."""
    return " ".join(map(digits, values))


def quoted(name: str) -> str:
    """Text in double quotes, of C++ and USD."""
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


WORLD = "world"  # name of a root link that MuJoCo and SDF predefine


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A joint of the URDF, fixed ones included."""

    name: str
    kind: str
    parent: str
    child: str
    placement: Array  # T from the frame of the child (at q = 0) to that of the parent, (4, 4)
    axis: Array  # unit vector in the frame of the child, (3,)
    lower: float | None  # lower, upper: rad or m, None without limit
    upper: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A URDF document; `root` is not shared and may be changed."""

    name: str  # name of the robot
    root: Element  # the <robot> element
    links: dict[str, Element]  # elements by link name
    edges: dict[str, Edge]  # joints by the name of their child link
    base: str  # root link
    moving: tuple[str, ...]  # moving links in the order of the library

    def carrier(self, link: str) -> tuple[str | None, Array]:
        """The moving link that a link is fixed to, None for the base, and T (4, 4) to it."""
        T = np.eye(4)
        while link not in self.moving and link in self.edges:
            T = self.edges[link].placement @ T
            link = self.edges[link].parent
        return (link if link in self.moving else None), T

    def published(self, link: str) -> RigidBody | None:
        """Rigid body of a link in the document; None without an <inertial>."""
        inertial = self.links[link].find("inertial")
        if inertial is None:
            return None
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        T = _placement(inertial, f"link '{link}'")
        entries = [
            0.0 if inertia is None else number(inertia.get(key, "0"), f"link '{link}': {key}")
            for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        ]
        inertia_com = inertia_matrix(entries)
        value = "0" if mass is None else mass.get("value", "0")
        return RigidBody(
            number(value, f"link '{link}': mass"), T[:3, 3], T[:3, :3] @ inertia_com @ T[:3, :3].T
        )

    def children(self, link: str) -> list[Edge]:
        """Joints below a link: moving ones in the order of the library, then fixed ones."""
        below = [edge for edge in self.edges.values() if edge.parent == link]
        return sorted(below, key=lambda edge: self._rank(edge.child))

    def _rank(self, link: str) -> int:
        """Index of the first moving joint at or below a link."""
        below = [self.moving.index(x) for x in self.subtree(link) if x in self.moving]
        return min(below, default=len(self.moving))

    def subtree(self, link: str) -> Iterator[str]:
        """Yield a link and all links below it."""
        yield link
        for edge in self.edges.values():
            if edge.parent == link:
                yield from self.subtree(edge.child)


def read_tree(lib: Library) -> Tree:
    """Tree of the URDF of a library."""
    root = _parse(lib, lib.urdf())
    links = {link.get("name", ""): link for link in root.findall("link")}
    missing = sorted(set(lib.link_names) - set(links))
    if missing:
        raise ExportError(
            f"the URDF of '{lib.name}' lacks the link '{missing[0]}'; run: python -m symgen build"
        )
    edges = {edge.child: edge for edge in map(_edge, root.findall("joint"))}
    joints = {edges[link].name for link in lib.link_names if link in edges}
    if joints != set(lib.all_joint_names):
        raise ExportError(
            f"the URDF of '{lib.name}' has the joints {', '.join(sorted(joints))}, the library "
            f"{', '.join(sorted(lib.all_joint_names))}; run: python -m symgen build"
        )
    roots = [link for link in links if link not in edges]
    tree = Tree(root.get("name") or lib.name, root, links, edges, (*roots, "")[0], lib.link_names)
    # Links on a loop, or on no link, are not below the root.
    if len(roots) != 1 or set(tree.subtree(roots[0])) != set(links):
        raise ExportError(
            f"the URDF of '{lib.name}' is not a tree of links (its roots are "
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
    bounds = [
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
        *bounds,
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
        raise ExportError(
            f"expected three numbers as {what} of the URDF, got '{text}'; "
            "run: python -m symgen build"
        )
    return np.array([number(word, what) for word in words])


def number(text: str, what: str) -> float:
    """Number of the URDF."""
    try:
        return float(text)
    except ValueError:
        raise ExportError(
            f"expected a number as {what} of the URDF, got '{text}'; run: python -m symgen build"
        ) from None


def link_keys(tree: Tree) -> dict[str, str]:
    """Keys of the links that move or have an inertial in the URDF, by link name."""
    return short_names(
        name for name in tree.links if name in tree.moving or tree.published(name) is not None
    )


def short_names(names: Iterable[str]) -> dict[str, str]:
    """Each name without the common prefix that ends at the last shared underscore."""
    listed = list(names)
    letters = takewhile(lambda each: len(set(each)) == 1, zip(*listed, strict=False))
    shared = "".join(each[0] for each in letters)
    cut = shared.rfind("_") + 1 if len(listed) > 1 else 0
    return {name: name[cut:] for name in listed}
