"""URDF text → `Model`, tolerant: what cannot be read becomes a finding, and reading goes on.

The text must be XML without DTD, entities and xacro. `symgen.chain` requires the rest when a
library is built.
"""

from collections.abc import Callable
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio

from symgen.chain.document import Document, numbers, parse
from symgen.errors import UrdfError
from symgen.inspect.model import ERROR, Array, Body, Finding, Joint, Link, Model, Shape

_SIZES = {
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "capsule": (("radius", 1), ("length", 1)),
    "sphere": (("radius", 1),),
}
HUGE = 1e9
"""Largest length, mass or inertia that is read (SI); products of larger ones overflow."""
SPECK = 1e-9
"""Smallest mass other than zero that is read, kg; quotients by smaller ones overflow."""
_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(text: str) -> Model:
    """Read everything in a URDF that can be read."""
    root = parse(text)
    reader = _Reader()
    links = {link.name: link for element in root.findall("link") for link in reader.link(element)}
    if not links:
        raise UrdfError("the URDF defines no link; a robot needs at least one")
    joints = [j for element in root.findall("joint") for j in reader.joint(element)]
    try:
        Document(text)
    except UrdfError as error:
        reader.fault("structure", "the tree", str(error).rstrip("."), "expected one tree of links")
    return Model(root.get("name") or "robot", "URDF", links, tuple(joints), tuple(reader.findings))


class _Reader:
    """Reads element by element and collects faults."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def fault(self, kind: str, where: str, observed: str, expected: str) -> None:
        self.findings.append(Finding(ERROR, kind, where, observed, expected))

    def link(self, element: Element) -> list[Link]:
        name = element.get("name")
        if not name:
            return []  # reported by the check of the structure
        where = f"link '{name}'"
        inertials = element.findall("inertial")
        if len(inertials) > 1:
            self.fault("structure", where, f"{len(inertials)} <inertial>", "expected at most one")
        body = self.body(inertials[0], where) if inertials else None
        shapes = [
            shape
            for tag in ("collision", "visual")
            for node in element.findall(tag)
            for shape in self.shape(node, where, tag == "collision")
        ]
        return [Link(name, body, tuple(shapes))]

    def body(self, inertial: Element, where: str) -> Body | None:
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        if mass is None or tensor is None:
            lacks = "<mass>" if mass is None else "<inertia>"
            self.fault("incomplete", where, f"an <inertial> without {lacks}", "expected both")
            return None
        m = self.number(mass, "value", where, "mass", None)
        entries = [self.number(tensor, key, where, f"inertia {key}", None) for key in _ENTRIES]
        place = self.placement(inertial, where)
        if m is None or place is None or any(x is None for x in entries):
            return None
        if 0 < abs(m) < SPECK:
            text = f"expected 0 or more than {SPECK:g} kg"
            self.fault("mass", where, f"the mass is {m:g} kg", text)
            return None
        xx, xy, xz, yy, yz, zz = entries
        rotation, com = place
        written = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
        if np.array_equal(rotation, np.eye(3)):
            return Body(m, com, written)
        turned = rotation @ written @ rotation.T
        return Body(m, com, (turned + turned.T) / 2)

    def shape(self, node: Element, where: str, is_collision: bool) -> list[Shape]:
        geometry = node.find("geometry")
        place = self.placement(node, where)
        if geometry is None or place is None:
            return []
        shapes = []
        for solid in geometry:
            if solid.tag == "mesh":
                scale = self.numbers(solid, "scale", 3, where, "mesh scale", np.ones(3))
                if scale is not None:
                    file = solid.get("filename", "")
                    size = tuple(map(float, scale))
                    shapes.append(Shape("mesh", size, *place, file, is_collision))
            elif solid.tag in _SIZES:
                parts = [
                    self.numbers(solid, key, count, where, f"{solid.tag} {key}", None)
                    for key, count in _SIZES[solid.tag]
                ]
                if all(part is not None for part in parts):
                    size = tuple(float(x) for part in parts if part is not None for x in part)
                    shapes.append(Shape(solid.tag, size, *place, "", is_collision))
        return shapes

    def joint(self, element: Element) -> list[Joint]:
        name, ends = element.get("name"), [element.find(tag) for tag in ("parent", "child")]
        if not name or any(end is None or not end.get("link") for end in ends):
            return []
        parent, child = (end.get("link", "") for end in ends if end is not None)
        where, kind = f"joint '{name}'", element.get("type", "")
        place = self.placement(element, where) or (np.eye(3), np.zeros(3))
        axis_node = element.find("axis")
        axis = np.array([1.0, 0.0, 0.0])
        if axis_node is not None:
            read = self.numbers(axis_node, "xyz", 3, where, "axis", axis)
            axis = axis if read is None else read
        values: dict[str, float | None] = {}
        for tag, keys in (
            ("limit", ("lower", "upper", "velocity", "effort")),
            ("dynamics", ("damping", "friction")),
        ):
            node = element.find(tag)
            for key in keys:
                is_given = node is not None and key in node.attrib
                values[key] = (
                    self.number(node, key, where, f"{tag} {key}", None)
                    if is_given and node is not None
                    else None
                )
        return [
            Joint(
                name,
                kind,
                parent,
                child,
                place[1],
                axis,
                lower=values["lower"],
                upper=values["upper"],
                velocity=values["velocity"],
                effort=values["effort"],
                damping=values["damping"],
                friction=values["friction"],
                rotation=place[0],
            )
        ]

    def placement(self, element: Element, where: str) -> tuple[Array, Array] | None:
        node = element.find("origin")
        if node is None:
            return np.eye(3), np.zeros(3)
        rpy = self.numbers(node, "rpy", 3, where, "origin rpy", np.zeros(3))
        xyz = self.numbers(node, "xyz", 3, where, "origin xyz", np.zeros(3))
        if rpy is None or xyz is None:
            return None
        return (pinocchio.rpy.rpyToMatrix(*rpy) if rpy.any() else np.eye(3)), xyz

    def numbers(
        self, node: Element, key: str, count: int, where: str, what: str, default: Array | None
    ) -> Array | None:
        if key not in node.attrib and default is not None:
            return default
        values = self._caught(lambda: numbers(node.get(key, ""), count, what), where, what)
        # Limits may have any size; lengths, masses and inertias are multiplied with each other.
        if values is None or what.startswith(("limit", "dynamics")) or np.abs(values).max() < HUGE:
            return values
        observed = f"the {what} is {node.get(key)}"
        self.fault("unreadable", where, observed, f"expected numbers in SI units, below {HUGE:g}")
        return None

    def number(
        self, node: Element, key: str, where: str, what: str, default: Array | None
    ) -> float | None:
        values = self.numbers(node, key, 1, where, what, default)
        return None if values is None else float(values[0])

    def _caught(self, read: Callable[[], Array], where: str, what: str) -> Array | None:
        try:
            return read()
        except UrdfError as error:
            self.fault("unreadable", where, str(error), f"expected the {what} as plain numbers")
            return None
