"""The URDF as a document: parsed without entities, one tree of named links and joints.

Cutting, locking and snapping are left to `normalise`, kinematics and inertias to pinocchio.
"""

from collections.abc import Iterator
from xml.etree.ElementTree import Element, ParseError, indent, tostring

import numpy as np
import pinocchio
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from symgen.errors import UrdfError

MOVING = ("revolute", "continuous", "prismatic")


class Document:
    """A URDF tree with the look-ups that cutting and locking need."""

    def __init__(self, text: str) -> None:
        self.root = parse(text)
        self.links = _named(self.root, "link")
        self.joints = _named(self.root, "joint")
        self.parent_joint: dict[str, str] = {}
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
        hanging = set(self.subtree(self.root_link))
        adrift = [link for link in self.links if link not in hanging]
        if adrift:
            raise UrdfError(
                f"the joints of {listing(adrift)} form a loop that does not hang on the root link "
                f"'{self.root_link}'; closed chains cannot be read"
            )

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
            joints.append(self.parent_joint[link])
            link = self.parent_link(joints[-1])
        return joints[::-1]

    def subtree(self, link: str) -> Iterator[str]:
        """A link and everything that hangs on it."""
        pending = [link]
        while pending:
            link = pending.pop()
            yield link
            pending += [self.child_link(joint) for joint in self.children(link)]

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
                f"its links are {listing(self.links)}"
            )

    def text(self) -> str:
        """The document as UTF-8 text, the same for the same tree."""
        indent(self.root, space="  ")
        return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(self.root, "unicode") + "\n"


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


def parse(text: str) -> Element:
    """The <robot> element of a URDF without DTD, entities or xacro instructions.

    Raises:
        UrdfError: one sentence that says what to mend.
    """
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


def listing(names: dict[str, Element] | list[str], most: int = 12) -> str:
    """The first names, comma by comma."""
    shown = list(names)
    return ", ".join(shown[:most]) + (", …" if len(shown) > most else "")
