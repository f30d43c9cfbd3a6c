"""The URDF of the kernels with identified inertials; all else stays as it was.

A joint's frame is the frame of the link it moves, so nothing is rotated.
"""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from runtime.outputs.model_files.bodies import Body, digits, row
from runtime.outputs.model_files.model import Model, xml_comment
from runtime.outputs.model_files.urdf_tree import Tree, number, read_tree

HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'


def urdf_text(model: Model) -> str:
    """The document with m, c and I_com of every moving link, and the friction where it is known."""
    tree = read_tree(model.lib)
    for link in model.split.emptied:
        set_inertial(tree, link, None)
    for link in model.lib.link_names:
        set_inertial(tree, link, model.split.bodies[link])
    for k, joint in enumerate(model.lib.joint_names):
        set_friction(tree, joint, model.drive.damping[k], model.drive.friction[k])
    return document_text(tree, xml_comment(model.robot_comment(*_without_driving(tree))))


def document_text(tree: Tree, comment: str = "") -> str:
    """A tree as a file."""
    indent(tree.root, space="  ")
    return HEAD + comment + tostring(tree.root, "unicode") + "\n"


def set_inertial(tree: Tree, link: str, body: Body | None) -> None:
    """Give a link this body, or none, in the place of the one it has."""
    element = tree.links[link]
    found = element.findall("inertial")
    place = list(element).index(found[0]) if found else 0
    for inertial in found:
        element.remove(inertial)
    if body is not None:
        element.insert(place, _inertial(body))


def _without_driving(tree: Tree) -> list[str]:
    """Take out published friction below zero, which would drive the joint; what was taken."""
    taken = []
    for joint in tree.root.findall("joint"):
        for node in joint.findall("dynamics"):
            for key, text in list(node.attrib.items()):
                if key in {"damping", "friction"} and number(text, key) < 0:
                    del node.attrib[key]
                    taken.append(f"the published {key} of {joint.get('name')}, {text}, would drive")
    return taken


def set_friction(tree: Tree, joint: str, damping: float | None, friction: float | None) -> None:
    """Write <dynamics>; what is None stays as it is."""
    element = next(x for x in tree.root.findall("joint") if x.get("name") == joint)
    for key, value in (("damping", damping), ("friction", friction)):
        if value is not None:
            node = element.find("dynamics")
            node = SubElement(element, "dynamics") if node is None else node
            node.set(key, digits(value))


def _inertial(body: Body) -> Element:
    inertial = Element("inertial")
    SubElement(inertial, "origin", {"xyz": row(body.com), "rpy": "0 0 0"})
    SubElement(inertial, "mass", {"value": digits(body.mass)})
    entries = {f"i{key}": digits(value) for key, value in body.entries().items()}
    SubElement(inertial, "inertia", entries)
    return inertial
