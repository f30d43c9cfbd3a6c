"""SDF 1.9 of a model that is fixed to the world: the poses of links and joints at q = 0.

SDF gives 1 kg to a link without <inertial>; such links become frames. Rotations are written as
quaternions, which keep all digits.
"""

from functools import partial
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.library import Array
from runtime.outputs.model_files.engines import drake
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import IdentifiedModel, require_no_coupling, xml_comment
from runtime.outputs.model_files.reload_check import compare_reloaded
from runtime.outputs.model_files.urdf_tree import WORLD, Edge, RigidBody, digits, quaternion, row

UNLIMITED = 1e16  # value of a limit that SDF reads as none [rad, m]
MASSLESS = "A link without mass is a frame in this file, because SDF would give it 1 kg."


def sdf_text(model: IdentifiedModel) -> str:
    """SDF model for Gazebo, Drake and other readers, without meshes and collisions."""
    require_no_coupling(model, "sdf")
    tree = model.tree
    root = Element("sdf", {"version": "1.9"})
    top = SubElement(root, "model", {"name": model.lib.name})
    if tree.base != WORLD:
        _link(model, top, tree.base)
        joint = SubElement(top, "joint", {"name": _free_name(model, "to_world"), "type": "fixed"})
        _ends(joint, WORLD, tree.base)
    _descend(model, top, tree.base)
    indent(root, space="  ")
    notes = [MASSLESS]
    on_world = [edge.child for edge in tree.children(WORLD)] if tree.base == WORLD else [tree.base]
    notes += [
        f"{link} is fixed to the world; SDF gives it 1 kg, which does not move."
        for link in on_world
        if not _has_mass(model, link)
    ]
    if model.lib.gravity[:2].any() or model.lib.gravity[2] >= 0:
        notes.append("Rotate the model so that gravity has the above direction in its base frame.")
    return xml_comment(model.robot_comment(*notes)) + tostring(root, "unicode") + "\n"


def _descend(model: IdentifiedModel, top: Element, link: str) -> None:
    for edge in model.tree.children(link):
        is_root = link == WORLD and link == model.tree.base
        parent = "__model__" if is_root else link
        # A frame of the model moves with its first link, so that what stands on the world is one.
        if is_root or _has_mass(model, edge.child):
            element = _link(model, top, edge.child)
            element.insert(0, _pose(edge.placement, parent))
            _joint(model, top, edge, link)
        else:
            frame = SubElement(top, "frame", {"name": edge.child, "attached_to": parent})
            frame.append(_pose(edge.placement))
        _descend(model, top, edge.child)


def _has_mass(model: IdentifiedModel, link: str) -> bool:
    body = model.bodies.by_link.get(link)
    return link in model.lib.link_names or (body is not None and body.mass > 0)


def _link(model: IdentifiedModel, top: Element, link: str) -> Element:
    element = SubElement(top, "link", {"name": link})
    body = model.bodies.by_link.get(link)
    if body is not None and body.mass > 0:
        element.append(_inertial(body))
    return element


def _inertial(body: RigidBody) -> Element:
    inertial = Element("inertial")
    SubElement(inertial, "pose").text = f"{row(body.com)} 0 0 0"
    SubElement(inertial, "mass").text = digits(body.mass)
    inertia = SubElement(inertial, "inertia")
    for key, value in body.entries().items():
        SubElement(inertia, f"i{key}").text = digits(value)
    return inertial


def _joint(model: IdentifiedModel, top: Element, edge: Edge, parent: str) -> None:
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
        finite = value if np.isfinite(value) else np.sign(value) * UNLIMITED
        SubElement(limit, key).text = digits(finite)
    for key in ("effort", "velocity"):
        if np.isfinite(bounds[key]):
            SubElement(limit, key).text = digits(float(bounds[key]))
    coefficients = {"damping": model.friction.damping[k], "friction": model.friction.friction[k]}
    if any(value is not None for value in coefficients.values()):
        dynamics = SubElement(axis, "dynamics")
        for key, known in coefficients.items():
            if known is not None:
                SubElement(dynamics, key).text = digits(known)


def _ends(joint: Element, parent: str, child: str) -> None:
    SubElement(joint, "parent").text = parent
    SubElement(joint, "child").text = child


def _free_name(model: IdentifiedModel, name: str) -> str:
    """A name that differs from all links and moving joints, which share one namespace in SDF."""
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


SDF = ExportFormat(
    "sdf",
    "SDF 1.9 with inertials and joint friction, for Gazebo and Drake",
    "{robot}.sdf",
    sdf_text,
    partial(compare_reloaded, drake),
)
