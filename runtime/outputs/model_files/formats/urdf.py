"""The URDF of the kernels with identified inertials and joint friction; all else is unchanged."""

from collections.abc import Iterator
from functools import partial
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from runtime.outputs.model_files.engines import pinocchio
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel, xml_comment
from runtime.outputs.model_files.reload_check import compare_reloaded
from runtime.outputs.model_files.urdf_tree import RigidBody, Tree, digits, number, read_tree, row

HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'


def set_inertial(tree: Tree, link: str, body: RigidBody | None) -> None:
    """Replace the <inertial> of a link."""
    element = tree.links[link]
    old = element.findall("inertial")
    place = list(element).index(old[0]) if old else 0
    for inertial in old:
        element.remove(inertial)
    if body is not None:
        inertial = Element("inertial")
        SubElement(inertial, "origin", {"xyz": row(body.com), "rpy": "0 0 0"})
        SubElement(inertial, "mass", {"value": digits(body.mass)})
        entries = {f"i{key}": digits(value) for key, value in body.entries().items()}
        SubElement(inertial, "inertia", entries)
        element.insert(place, inertial)


def set_friction(tree: Tree, joint: str, damping: float | None, friction: float | None) -> None:
    """Write the <dynamics> of a joint."""
    element = next(x for x in tree.root.findall("joint") if x.get("name") == joint)
    for key, value in (("damping", damping), ("friction", friction)):
        if value is not None:
            node = element.find("dynamics")
            node = SubElement(element, "dynamics") if node is None else node
            node.set(key, digits(value))


def urdf_text(model: IdentifiedModel) -> str:
    """URDF with m, c and I_com of every moving link, and joint friction where it is known."""
    tree = read_tree(model.lib)
    for link in model.bodies.emptied:
        set_inertial(tree, link, None)
    for link in model.lib.link_names:
        set_inertial(tree, link, model.bodies.by_link[link])
    for k, joint in enumerate(model.lib.joint_names):
        set_friction(tree, joint, model.friction.damping[k], model.friction.friction[k])
    comment = xml_comment(model.robot_comment(*_remove_driving_friction(tree)))
    indent(tree.root, space="  ")
    return HEAD + comment + tostring(tree.root, "unicode") + "\n"


def _remove_driving_friction(tree: Tree) -> Iterator[str]:
    """Remove published friction below zero, which would drive the joint; one note per value."""
    for joint in tree.root.findall("joint"):
        for node in joint.findall("dynamics"):
            for key, text in list(node.attrib.items()):
                if key in {"damping", "friction"} and number(text, key) < 0:
                    del node.attrib[key]
                    yield (
                        f"The published {key} of {joint.get('name')}, {text}, is negative and "
                        "was removed."
                    )


URDF = ExportFormat(
    "urdf",
    "URDF with inertials and joint friction, for pinocchio, ROS, PyBullet and Drake",
    "{robot}.urdf",
    urdf_text,
    partial(compare_reloaded, pinocchio),
    takes_free_base=True,
)
