"""The XML of a URDF: parsed without entities, as one tree of named links and joints; new elements.

Cutting, locking and snapping are left to `normalise`, kinematics and inertias to pinocchio.
"""

import re
from collections.abc import Collection, Iterable, Iterator
from typing import Any
from xml.etree.ElementTree import Element, ParseError, SubElement, indent, tostring

import numpy as np
import pinocchio
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from symgen.errors import UrdfError

MOVING = ("revolute", "continuous", "prismatic")  # types of joints that can be modelled as moving
_UNBOUND = 27  # code of expat for a prefix without xmlns
_FIRST = re.compile(
    r"\ufeff?(?:\s+|<\?.*?\?>|<!--.*?-->|<![A-Za-z][^>\[]*(?:\[.*?\]\s*)?>)*+<([A-Za-z_][\w.:-]*)",
    re.DOTALL,
)
MOST_LINKS = 500  # most links of a URDF; look-ups and comparisons grow with their square


class Document:
    """A URDF, one tree of named links, with the look-ups that cutting and locking need."""

    def __init__(self, text: str) -> None:
        self.root = parse(text)  # the <robot> element
        self.links = _named(self.root, "link")  # name → element
        self.joints = _named(self.root, "joint")
        self.parent_joint: dict[str, str] = {}  # child link → the joint that carries it
        for name in self.joints:
            parent, child = self.parent_link(name), self.child_link(name)
            for link in (parent, child):
                if link not in self.links:
                    raise UrdfError(
                        f"joint '{name}' names the link '{link}', which the URDF does not define; "
                        f"its links are {listing(self.links)}"
                    )
            if child in self.parent_joint:
                raise UrdfError(
                    f"link '{child}' has two parent joints, '{self.parent_joint[child]}' and "
                    f"'{name}'; a kinematic tree needs exactly one"
                )
            self.parent_joint[child] = name
        roots = [link for link in self.links if link not in self.parent_joint]
        if len(roots) != 1:
            raise UrdfError(
                f"a robot needs exactly one root link, this URDF has {len(roots)}: "
                f"{listing(roots)}; connect the others with joints or delete them"
            )
        self.root_link = roots[0]
        reached = set(self.subtree(self.root_link))
        adrift = [link for link in self.links if link not in reached]
        if adrift:
            raise UrdfError(
                f"the joints of {listing(adrift)} form a loop without connection to the root link "
                f"'{self.root_link}', but a URDF describes a tree; remove the joint that closes "
                "the loop and state it as [[loop]] in a mechanism file (--mechanism)"
            )

    @property
    def name(self) -> str:
        """Name of the robot in the URDF."""
        return self.root.get("name") or "robot"

    def parent_link(self, joint: str) -> str:
        """Name of the link that carries a joint."""
        return self._end(joint, "parent")

    def child_link(self, joint: str) -> str:
        """Name of the link that a joint moves."""
        return self._end(joint, "child")

    def _end(self, joint: str, which: str) -> str:
        element = self.joints[joint].find(which)
        link = element.get("link") if element is not None else None
        if not link:
            raise UrdfError(f"joint '{joint}' has no <{which} link=…>; add one")
        return link

    def kind(self, joint: str) -> str:
        """Type of a joint: revolute, continuous, prismatic, fixed, floating, planar, …"""
        return self.joints[joint].get("type", "")

    def children(self, link: str) -> list[str]:
        """Joints whose parent is a link, in document order."""
        return [j for j in self.joints if self.parent_link(j) == link]

    def path(self, link: str) -> list[str]:
        """Joints from the root to a link."""
        joints: list[str] = []
        while link in self.parent_joint:
            joints.append(self.parent_joint[link])
            link = self.parent_link(joints[-1])
        return joints[::-1]

    def subtree(self, link: str) -> Iterator[str]:
        """Yield a link and all links beyond it."""
        pending = [link]
        while pending:
            link = pending.pop()
            yield link
            pending += [self.child_link(joint) for joint in self.children(link)]

    def fixed_to(self, link: str, beside: Collection[str] = ()) -> Iterator[str]:
        """Yield the links that are fixed to a link, directly or not, without `beside`."""
        for joint in self.children(link):
            child = self.child_link(joint)
            if self.kind(joint) == "fixed" and child not in beside:
                yield child
                yield from self.fixed_to(child, beside)

    def remove(self, links: set[str]) -> None:
        """Delete links and all joints whose parent or child they are."""
        removed = [j for j in self.joints if {self.parent_link(j), self.child_link(j)} & links]
        for joint in removed:
            self.parent_joint.pop(self.child_link(joint), None)
            self.root.remove(self.joints.pop(joint))
        for link in links:
            self.root.remove(self.links.pop(link))

    def has_base_joint(self) -> bool:
        """Whether a fixed joint attaches the robot to an empty root link such as "world"."""
        root, joints = self.links[self.root_link], self.children(self.root_link)
        empty = all(root.find(tag) is None for tag in ("inertial", "visual", "collision"))
        return empty and any(self.kind(joint) == "fixed" for joint in joints)

    def require_link(self, link: str, option: str) -> None:
        """Check that a link exists."""
        if link not in self.links:
            raise UrdfError(
                f"{option} names the link '{link}', which the URDF does not define; "
                f"its links are {listing(self.links)}"
            )

    def text(self) -> str:
        """The document as UTF-8 text; equal trees give equal text."""
        indent(self.root, space="  ")
        return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(self.root, "unicode") + "\n"


def origin(element: Element, owner: str) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation of the <origin> of an element, the identity if it has none."""
    node = element.find("origin")
    if node is None:
        return np.eye(3), np.zeros(3)
    rpy = numbers(node.get("rpy", "0 0 0"), 3, f"{owner}: origin rpy")
    xyz = numbers(node.get("xyz", "0 0 0"), 3, f"{owner}: origin xyz")
    return pinocchio.rpy.rpyToMatrix(*rpy), xyz


def axis_of(joint: Element, owner: str) -> np.ndarray:
    """Direction of the axis of a joint, x where it states none."""
    node = joint.find("axis")
    axis = numbers("1 0 0" if node is None else node.get("xyz", "1 0 0"), 3, f"{owner}: axis")
    size = np.abs(axis).max()
    if not size > 0:
        raise UrdfError(f"{owner} has the axis 0 0 0; give it a direction")
    if not 1e-100 < size < 1e100:  # its square overflows or vanishes
        raise UrdfError(
            f"{owner} has an axis of length {size:g}, expected about 1; give a unit vector"
        )
    return axis


def numbers(text: str, count: int, what: str) -> np.ndarray:
    """Finite numbers of an attribute."""
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise UrdfError(f"{what} needs {count} finite number(s), got '{text}'")
    return values


def first_element(text: str) -> str:
    """Name of the first element of an XML text, which may be malformed; empty for none."""
    match = _FIRST.match(text)
    return match[1] if match else ""


def parse(text: str) -> Element:
    """Return the <robot> element of a URDF without DTD, entities or xacro instructions."""
    try:
        root = _elements(text)
    except DefusedXmlException:
        raise UrdfError(
            "the URDF declares a DTD or entities, which a robot description does not need; "
            "remove the <!DOCTYPE …> block"
        ) from None
    except (ParseError, ValueError) as error:
        raise UrdfError(f"the URDF is not well-formed XML ({error}); correct the file") from None
    count = len(root.findall("link"))
    if count > MOST_LINKS:
        raise UrdfError(
            f"expected at most {MOST_LINKS} links, got {count}; select a part of the robot"
        )
    if root.tag != "robot":
        raise UrdfError(f"expected a URDF whose first element is <robot>, got <{root.tag}>")
    for element in root.iter():
        if isinstance(element.tag, str) and "xacro}" in element.tag:
            raise UrdfError(
                f"the file contains the xacro instruction <{element.tag.split('}')[1]}>; "
                "expand it first: xacro in.xacro > out.urdf"
            )
    return root


def _elements(text: str) -> Element:
    """Root element; prefixes without xmlns, which the parser of ROS reads too, are declared."""
    try:
        return fromstring(text, forbid_dtd=True)
    except ParseError as error:
        first = _FIRST.match(text)
        if first is None or error.code != _UNBOUND:
            raise
        used = set(re.findall(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]", text))
        missing = sorted(used - {"xml", "xmlns", *re.findall(r"xmlns:([\w.-]+)", text)})
        declared = " ".join(f'xmlns:{prefix}="undeclared:{prefix}"' for prefix in missing)
        return fromstring(
            f"{text[: first.end(1)]} {declared}{text[first.end(1) :]}", forbid_dtd=True
        )


def _named(root: Element, tag: str) -> dict[str, Element]:
    elements: dict[str, Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise UrdfError(f"a <{tag}> has no name; give it one")
        if name in elements:
            raise UrdfError(f"two {tag}s are called '{name}'; names must be unique")
        elements[name] = element
    if tag == "link" and not elements:
        raise UrdfError("the URDF defines no link; a robot needs at least one")
    return elements


def listing(names: Iterable[str], most: int = 12) -> str:
    """The first names, separated by commas."""
    shown = list(names)
    return ", ".join(shown[:most]) + (", …" if len(shown) > most else "")


def add_joint(
    robot: Element,
    name: str,
    kind: str,
    ends: tuple[str, str],
    at: Any,
    rotation: Any,
    axis: Any = None,
    limits: dict[str, float] | None = None,
    dynamics: dict[str, float] | None = None,
) -> None:
    """Joint of two links, of one that moves with the limits and the friction that it has."""
    joint = SubElement(robot, "joint", {"name": name, "type": kind})
    add_origin(joint, at, rotation)
    for tag, link in zip(("parent", "child"), ends, strict=True):
        SubElement(joint, tag, {"link": link})
    if axis is not None:
        SubElement(joint, "axis", {"xyz": words(axis)})
    if limits is not None:  # a 0 of effort or velocity is none
        values = {key: words(value) for key, value in limits.items()}
        SubElement(joint, "limit", {"effort": "0", "velocity": "0"} | values)
    if dynamics and any(dynamics.values()):
        SubElement(joint, "dynamics", {key: words(value) for key, value in dynamics.items()})


def add_origin(element: Element, at: Any, rotation: Any) -> None:
    """Placement of a joint or of an inertial."""
    rpy = pinocchio.rpy.matrixToRpy(rotation)
    SubElement(element, "origin", {"xyz": words(at), "rpy": words(rpy)})


def add_inertial(link: Element, mass: float, com: Any, inertia: np.ndarray) -> None:
    """Inertial of a link, its inertia (3, 3) about the centre of mass."""
    element = SubElement(link, "inertial")
    SubElement(element, "origin", {"xyz": words(com)})
    SubElement(element, "mass", {"value": words(mass)})
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = inertia[np.triu_indices(3)]
    SubElement(element, "inertia", {k: words(v) for k, v in zip(keys, values, strict=True)})


def words(values: Any) -> str:
    """Numbers with all their digits."""
    return " ".join(f"{x + 0.0:.17g}" for x in np.ravel(values))
