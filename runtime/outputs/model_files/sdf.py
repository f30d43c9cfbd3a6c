"""SDF 1.9 of a model that is fixed to the world: the poses of links and joints at q = 0.

A link without <inertial> would weigh 1 kg in SDF; such links become frames. Rotations are written
as quaternions, which lose no digits.
"""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.library import Array
from runtime.outputs.model_files.bodies import Body, digits, quaternion, row
from runtime.outputs.model_files.model import Model, xml_comment
from runtime.outputs.model_files.urdf_tree import WORLD, Edge

UNLIMITED = 1e16
"""What SDF takes for no limit."""
FREE = "A link without mass is a frame here, because SDF would give it 1 kg."


def sdf_text(model: Model) -> str:
    """A model file for Gazebo, Drake and other readers of SDF; no meshes, no collisions."""
    tree = model.tree
    root = Element("sdf", {"version": "1.9"})
    top = SubElement(root, "model", {"name": model.lib.name})
    if tree.base != WORLD:
        _link(model, top, tree.base)
        joint = SubElement(top, "joint", {"name": _free_name(model, "to_world"), "type": "fixed"})
        _ends(joint, WORLD, tree.base)
    _descend(model, top, tree.base)
    indent(root, space="  ")
    notes = [FREE]
    if tree.base != WORLD and tree.base not in model.split.bodies:
        notes.append(f"{tree.base} is fixed to the world and has the 1 kg that SDF gives it.")
    if model.lib.gravity[:2].any() or model.lib.gravity[2] >= 0:
        notes.append("Turn the model so that gravity points as above in its base frame.")
    return xml_comment(model.robot_comment(*notes)) + tostring(root, "unicode") + "\n"


def _descend(model: Model, top: Element, link: str) -> None:
    for edge in model.tree.children(link):
        is_root = link == WORLD and link == model.tree.base
        parent = "__model__" if is_root else link
        if _has_mass(model, edge.child):
            element = _link(model, top, edge.child)
            element.insert(0, _pose(edge.placement, parent))
            _joint(model, top, edge, link)
        else:
            frame = SubElement(top, "frame", {"name": edge.child, "attached_to": parent})
            frame.append(_pose(edge.placement))
        _descend(model, top, edge.child)


def _has_mass(model: Model, link: str) -> bool:
    body = model.split.bodies.get(link)
    return link in model.lib.link_names or (body is not None and body.mass > 0)


def _link(model: Model, top: Element, link: str) -> Element:
    element = SubElement(top, "link", {"name": link})
    body = model.split.bodies.get(link)
    if body is not None and body.mass > 0:
        element.append(_inertial(body))
    return element


def _inertial(body: Body) -> Element:
    inertial = Element("inertial")
    SubElement(inertial, "pose").text = f"{row(body.com)} 0 0 0"
    SubElement(inertial, "mass").text = digits(body.mass)
    inertia = SubElement(inertial, "inertia")
    for key, value in body.entries().items():
        SubElement(inertia, f"i{key}").text = digits(value)
    return inertial


def _joint(model: Model, top: Element, edge: Edge, parent: str) -> None:
    name = edge.name if edge.kind != "fixed" else _free_name(model, edge.name)
    joint = SubElement(top, "joint", {"name": name, "type": edge.kind})
    _ends(joint, parent, edge.child)
    if edge.kind == "fixed":
        return
    axis = SubElement(joint, "axis")
    SubElement(axis, "xyz").text = row(edge.axis)
    k = model.lib.joint_names.index(edge.name)
    limit = SubElement(axis, "limit")
    bounds = {key: values[k] for key, values in model.lib.limits().items() if values.ndim}
    for key in ("lower", "upper"):
        value = float(bounds[key])
        SubElement(limit, key).text = digits(
            value if np.isfinite(value) else np.sign(value) * UNLIMITED
        )
    for key in ("effort", "velocity"):
        if np.isfinite(bounds[key]):
            SubElement(limit, key).text = digits(float(bounds[key]))
    said = {"damping": model.drive.damping[k], "friction": model.drive.friction[k]}
    if any(value is not None for value in said.values()):
        dynamics = SubElement(axis, "dynamics")
        for key, known in said.items():
            if known is not None:
                SubElement(dynamics, key).text = digits(known)


def _ends(joint: Element, parent: str, child: str) -> None:
    SubElement(joint, "parent").text = parent
    SubElement(joint, "child").text = child


def _free_name(model: Model, name: str) -> str:
    """A name that no link and no moving joint has: in SDF they share one set of names."""
    taken = {*model.tree.links, *model.lib.joint_names}
    while name in taken:
        name += "_fixed"
    return name


def _pose(T: Array, relative_to: str | None = None) -> Element:
    w, x, y, z = quaternion(T)
    pose = Element("pose", {"rotation_format": "quat_xyzw"})
    if relative_to is not None:
        pose.set("relative_to", relative_to)
    pose.text = f"{row(T[:3, 3])} {row(np.array([x, y, z, w]))}"
    return pose
