"""Edits of a URDF tree: inertials and joint friction replaced, all else unchanged.

The frame of a joint is the frame of the link that it moves, so nothing is rotated.
"""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from runtime.outputs.model_files.bodies import RigidBody, digits, row
from runtime.outputs.model_files.urdf_tree import Tree

HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'


def document_text(tree: Tree, comment: str = "") -> str:
    """Text of a URDF file."""
    indent(tree.root, space="  ")
    return HEAD + comment + tostring(tree.root, "unicode") + "\n"


def set_inertial(tree: Tree, link: str, body: RigidBody | None) -> None:
    """Replace the <inertial> of a link."""
    element = tree.links[link]
    old = element.findall("inertial")
    place = list(element).index(old[0]) if old else 0
    for inertial in old:
        element.remove(inertial)
    if body is not None:
        element.insert(place, _inertial(body))


def set_friction(tree: Tree, joint: str, damping: float | None, friction: float | None) -> None:
    """Write the <dynamics> of a joint."""
    element = next(x for x in tree.root.findall("joint") if x.get("name") == joint)
    for key, value in (("damping", damping), ("friction", friction)):
        if value is not None:
            node = element.find("dynamics")
            node = SubElement(element, "dynamics") if node is None else node
            node.set(key, digits(value))


def _inertial(body: RigidBody) -> Element:
    inertial = Element("inertial")
    SubElement(inertial, "origin", {"xyz": row(body.com), "rpy": "0 0 0"})
    SubElement(inertial, "mass", {"value": digits(body.mass)})
    entries = {f"i{key}": digits(value) for key, value in body.entries().items()}
    SubElement(inertial, "inertia", entries)
    return inertial
