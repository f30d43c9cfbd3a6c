"""The URDF as a document: parsed without entities, cut to a sub-chain, locked and snapped.

The result is again a URDF, the one that the kernels describe, the manifest's hash covers and
`runtime.export` fills with identified numbers. Kinematics and inertias are left to pinocchio.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, ParseError, indent, tostring

import numpy as np
import pinocchio
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from symgen.errors import UrdfError

MOVING = ("revolute", "continuous", "prismatic")
_HALF_PI = math.pi / 2


@dataclass(frozen=True, slots=True)
class ChainOptions:
    """What the user asks of the URDF beyond reading it.

    Attributes:
        base: link that becomes the fixed base; None keeps the root.
        tip: link that ends the chain; what lies beyond is cut off, not lumped.
        gravity: m/s² in the frame of the base link; None takes (0, 0, −9.81) in the root frame.
        locks: joint name → value (rad, m) at which the joint becomes part of its parent.
        snap: rad; rpy angles within this of a multiple of π/2 are taken as meant exactly.
    """

    base: str | None = None
    tip: str | None = None
    gravity: tuple[float, float, float] | None = None
    locks: dict[str, float] = field(default_factory=dict)
    snap: float = 0.0


class Document:
    """A URDF tree with the look-ups that cutting and locking need."""

    def __init__(self, text: str) -> None:
        self.root = _parse(text)
        self.links = _named(self.root, "link")
        self.joints = _named(self.root, "joint")
        self.parent_joint: dict[str, str] = {}
        for name in self.joints:
            parent, child = self.parent_link(name), self.child_link(name)
            for link in (parent, child):
                if link not in self.links:
                    raise UrdfError(
                        f"joint '{name}' names the link '{link}', which the URDF does not define; "
                        f"its links are {_listing(self.links)}"
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
                f"{_listing(roots)}; connect the others with joints or delete them"
            )
        self.root_link = roots[0]

    @property
    def name(self) -> str:
        """The robot's name as the URDF gives it."""
        return self.root.get("name") or "robot"

    def parent_link(self, joint: str) -> str:
        """Link that carries the joint."""
        return self._end(joint, "parent")

    def child_link(self, joint: str) -> str:
        """Link that the joint moves."""
        return self._end(joint, "child")

    def _end(self, joint: str, which: str) -> str:
        element = self.joints[joint].find(which)
        link = element.get("link") if element is not None else None
        if not link:
            raise UrdfError(f"joint '{joint}' has no <{which} link=…>; add one")
        return link

    def kind(self, joint: str) -> str:
        """revolute, continuous, prismatic, fixed, floating, planar, …"""
        return self.joints[joint].get("type", "")

    def children(self, link: str) -> list[str]:
        """Joints that hang on a link, in document order."""
        return [j for j in self.joints if self.parent_link(j) == link]

    def path(self, link: str) -> list[str]:
        """Joints from the root to a link."""
        joints: list[str] = []
        while link in self.parent_joint:
            joint = self.parent_joint[link]
            if joint in joints:
                raise UrdfError(f"joint '{joint}' is part of a loop; closed chains cannot be read")
            joints.append(joint)
            link = self.parent_link(joint)
        return joints[::-1]

    def subtree(self, link: str) -> Iterator[str]:
        """A link and everything that hangs on it."""
        yield link
        for joint in self.children(link):
            yield from self.subtree(self.child_link(joint))

    def remove(self, links: set[str]) -> None:
        """Delete links and the joints that move or carry them."""
        gone = [j for j in self.joints if {self.parent_link(j), self.child_link(j)} & links]
        for joint in gone:
            self.parent_joint.pop(self.child_link(joint), None)
            self.root.remove(self.joints.pop(joint))
        for link in links:
            self.root.remove(self.links.pop(link))

    def require_link(self, link: str, option: str) -> None:
        """Raise when an option names a link that does not exist."""
        if link not in self.links:
            raise UrdfError(
                f"{option} names the link '{link}', which the URDF does not define; "
                f"its links are {_listing(self.links)}"
            )

    def text(self) -> str:
        """The document as UTF-8 text, the same for the same tree."""
        indent(self.root, space="  ")
        return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(self.root, "unicode") + "\n"


def normalise(text: str, options: ChainOptions) -> tuple[Document, np.ndarray, tuple[str, ...]]:
    """Lock, cut and snap; returns the document, gravity in the base frame, and the cut links.

    Raises:
        UrdfError: one sentence that names the joint, the link or the option.
    """
    document = Document(text)
    for joint, value in options.locks.items():
        _lock(document, joint, value)
    gravity = _gravity(document, options)
    removed = _cut(document, options)
    _require_supported(document)
    if options.snap:
        _snap(document, options.snap)
    return document, gravity, removed


def origin(element: Element, owner: str) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation of an <origin>, identity when it is absent."""
    node = element.find("origin")
    if node is None:
        return np.eye(3), np.zeros(3)
    rpy = numbers(node.get("rpy", "0 0 0"), 3, f"{owner}: origin rpy")
    return pinocchio.rpy.rpyToMatrix(*rpy), numbers(
        node.get("xyz", "0 0 0"), 3, f"{owner}: origin xyz"
    )


def numbers(text: str, count: int, what: str) -> np.ndarray:
    """`count` finite numbers of an attribute."""
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise UrdfError(f"{what} needs {count} finite number(s), got '{text}'")
    return values


def _parse(text: str) -> Element:
    try:
        root = fromstring(text, forbid_dtd=True)
    except DefusedXmlException:
        raise UrdfError(
            "the URDF declares a DTD or entities, which a robot description does not need; "
            "remove the <!DOCTYPE …> block"
        ) from None
    except (ParseError, ValueError) as error:
        raise UrdfError(f"the URDF is not well-formed XML ({error}); mend the file") from None
    if root.tag != "robot":
        raise UrdfError(f"expected a URDF whose first element is <robot>, got <{root.tag}>")
    for element in root.iter():
        if isinstance(element.tag, str) and "xacro}" in element.tag:
            raise UrdfError(
                f"the file still holds the xacro instruction <{element.tag.split('}')[1]}>; "
                "expand it first: xacro in.xacro > out.urdf"
            )
    return root


def _named(root: Element, tag: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise UrdfError(f"a <{tag}> has no name; give it one")
        if name in found:
            raise UrdfError(f"two {tag}s are called '{name}'; names must be unique")
        found[name] = element
    if tag == "link" and not found:
        raise UrdfError("the URDF defines no link")
    return found


def _require_supported(document: Document) -> None:
    for name, element in document.joints.items():
        kind = document.kind(name)
        way_out = "lock it with --lock JOINT=VALUE or cut it off with --tip LINK"
        if kind not in {*MOVING, "fixed"}:
            raise UrdfError(
                f"joint '{name}' has the type '{kind}'; revolute, continuous, prismatic and fixed "
                f"joints can be modelled, so {way_out}"
            )
        if element.find("mimic") is not None and kind != "fixed":
            raise UrdfError(f"joint '{name}' mimics another joint; {way_out}")


def _lock(document: Document, joint: str, value: float) -> None:
    if joint not in document.joints:
        raise UrdfError(
            f"--lock names the joint '{joint}', which the URDF does not define; its joints are "
            f"{_listing(document.joints)}"
        )
    kind = document.kind(joint)
    if kind not in MOVING:
        raise UrdfError(f"--lock names the joint '{joint}', which is {kind} and does not move")
    if not math.isfinite(value):
        raise UrdfError(f"--lock {joint}={value}: expected a finite value in rad or m")
    element = document.joints[joint]
    axis_node = element.find("axis")
    axis = numbers(
        axis_node.get("xyz", "1 0 0") if axis_node is not None else "1 0 0",
        3,
        f"joint '{joint}': axis",
    )
    if not np.linalg.norm(axis) > 0:
        raise UrdfError(f"joint '{joint}' has the axis 0 0 0; give it a direction")
    axis = axis / np.linalg.norm(axis)
    rotation, translation = origin(element, f"joint '{joint}'")
    if kind == "prismatic":
        translation = translation + rotation @ axis * value
    else:
        rotation = rotation @ pinocchio.AngleAxis(value, axis).toRotationMatrix()
    for tag in ("axis", "limit", "dynamics", "mimic", "safety_controller", "origin"):
        node = element.find(tag)
        if node is not None:
            element.remove(node)
    element.set("type", "fixed")
    rpy = pinocchio.rpy.matrixToRpy(rotation)
    element.append(
        Element(
            "origin",
            {
                "xyz": " ".join(f"{x:.17g}" for x in translation),
                "rpy": " ".join(f"{x:.17g}" for x in rpy),
            },
        )
    )


def _gravity(document: Document, options: ChainOptions) -> np.ndarray:
    if options.gravity is not None:
        gravity = np.array(options.gravity, dtype=float)
        if gravity.shape != (3,) or not np.isfinite(gravity).all():
            raise UrdfError(f"--gravity needs three finite numbers, got {options.gravity}")
        return gravity
    base = options.base or document.root_link
    document.require_link(base, "--base")
    rotation = np.eye(3)
    for joint in document.path(base):
        if document.kind(joint) != "fixed":
            raise UrdfError(
                f"joint '{joint}' moves between the root link and --base {base}, so the direction "
                "of gravity in the base frame is unknown; state it with --gravity X,Y,Z"
            )
        rotation = rotation @ origin(document.joints[joint], f"joint '{joint}'")[0]
    return rotation.T @ np.array([0.0, 0.0, -9.81])


def _cut(document: Document, options: ChainOptions) -> tuple[str, ...]:
    base = options.base or document.root_link
    document.require_link(base, "--base")
    keep = set(document.subtree(base))
    if options.tip is not None:
        tip = options.tip
        document.require_link(tip, "--tip")
        if tip not in keep:
            raise UrdfError(f"--tip {tip} does not hang on --base {base}; choose a tip below it")
        on_path = {base, *(document.child_link(j) for j in document.path(tip))} & keep
        keep = set(on_path)
        for link in on_path - {tip}:
            keep |= set(_rigid(document, link, on_path))
    removed = set(document.links) - keep
    document.remove(removed)
    return tuple(sorted(removed))


def _rigid(document: Document, link: str, on_path: set[str]) -> Iterator[str]:
    """Links fixed to `link` off the path: brackets and cameras that belong to it."""
    for joint in document.children(link):
        child = document.child_link(joint)
        if document.kind(joint) == "fixed" and child not in on_path:
            yield child
            yield from _rigid(document, child, on_path)


def _snap(document: Document, tolerance: float) -> None:
    if not 0 < tolerance < 0.1:
        raise UrdfError(f"--snap needs an angle between 0 and 0.1 rad, got {tolerance:g}")
    for name, element in document.joints.items():
        node = element.find("origin")
        if node is None or "rpy" not in node.attrib:
            continue
        rpy = numbers(node.get("rpy", ""), 3, f"joint '{name}': origin rpy")
        meant = np.round(rpy / _HALF_PI) * _HALF_PI
        snapped = np.where(np.abs(rpy - meant) <= tolerance, meant, rpy)
        node.set("rpy", " ".join(f"{x:.17g}" for x in snapped))


def _listing(names: dict[str, Element] | list[str], most: int = 12) -> str:
    shown = list(names)
    return ", ".join(shown[:most]) + (", …" if len(shown) > most else "")
