"""MJCF of MuJoCo: inertials, joints in the order of the library, gravity, ranges, friction.

Joints that follow others and closed loops become equalities; motors drive the independent joints.

Dry friction becomes frictionloss, which MuJoCo treats as a constraint; damping and armature keep
their meaning. Collision proxies of the robot become visible capsules without contacts.
"""

from functools import partial
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from runtime.errors import ExportError
from runtime.library.manifest import FrameFacts, Manifest
from runtime.outputs.model_files.engines import mujoco
from runtime.outputs.model_files.export_format import ExportFormat
from runtime.outputs.model_files.model import (
    IdentifiedModel,
    couplings,
    require_loop_frames,
    xml_comment,
)
from runtime.outputs.model_files.reload_check import compare_reloaded
from runtime.outputs.model_files.urdf_tree import WORLD, Edge, digits, quaternion, row

LEVER = 0.1  # distance of the two points along the axis of a revolute loop joint [m]


def require_equalities(model: IdentifiedModel) -> None:
    """Raise ExportError where an equality of MuJoCo cannot state a loop joint."""
    require_loop_frames(model)
    manifest = model.lib.manifest
    for name, joint in zip(manifest.loops, manifest.loop_joints, strict=False):
        if joint.kind in {"prismatic", "cylindrical"}:
            raise ExportError(
                f"not written: {name} is {joint.kind}, which no equality of MuJoCo states; "
                "export urdf, which holds the tree of the robot"
            )


def add_equalities(model: IdentifiedModel, root: Element) -> None:
    """Add equalities, tendons and sites to a document."""
    manifest = model.lib.manifest
    if manifest.coupling is None and not manifest.loops:
        return
    equality = Element("equality")
    _couplings(manifest, root, equality)
    bodies = {body.get("name"): body for body in root.iter("body")}
    world = root.find("worldbody")
    for k, joint in enumerate(manifest.loop_joints):
        points = [np.zeros(3)]
        if joint.kind == "revolute":
            points.append(np.array([0.0, 0.0, LEVER]))
        for m, point in enumerate(points):
            sites = {}
            for key, side, frame in (("site1", "a", joint.parent), ("site2", "b", joint.child)):
                sites[key] = f"loop{k + 1}{side}{m + 1}"
                _site(bodies.get(frame.link, world), sites[key], frame, point)
            SubElement(equality, "weld" if joint.kind == "fixed" else "connect", sites)
    root.append(equality)


def _couplings(manifest: Manifest, root: Element, equality: Element) -> None:
    """Equalities of the joints that follow others."""
    tendons = Element("tendon")
    for name, (masters, offset) in couplings(manifest).items():
        if len(masters) == 1:
            ((master, factor),) = masters.items()
            polynomial = f"{digits(offset)} {digits(factor)} 0 0 0"
            terms = {"joint1": name, "joint2": master, "polycoef": polynomial}
            SubElement(equality, "joint", terms)
            continue
        tendon = SubElement(tendons, "fixed", {"name": name})
        SubElement(tendon, "joint", {"joint": name, "coef": "1"})
        for master, factor in masters.items():
            SubElement(tendon, "joint", {"joint": master, "coef": digits(-factor)})
        terms = {"tendon1": name, "polycoef": f"{digits(offset)} 0 0 0 0"}
        SubElement(equality, "tendon", terms)
    if len(tendons):
        root.append(tendons)


def _site(body: Element | None, name: str, frame: FrameFacts, point: np.ndarray) -> None:
    """A site at a point of a frame of a link."""
    if body is None:
        raise ExportError(f"not written: the link '{frame.link}' of a loop is no body of the file")
    placement = np.eye(4)
    placement[:3, :3] = frame.rotation
    placement[:3, 3] = np.array(frame.translation) + placement[:3, :3] @ point
    attributes = {"pos": row(placement[:3, 3]), "quat": row(quaternion(placement))}
    SubElement(body, "site", {"name": name, **attributes})


KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}


def mjcf_text(model: IdentifiedModel) -> str:
    """MJCF that `mujoco.MjModel.from_xml_path` loads, without meshes and contacts."""
    require_equalities(model)
    lib, tree = model.lib, model.tree
    root = Element("mujoco", {"model": lib.name})
    options = {"angle": "radian", "autolimits": "false", "inertiafromgeom": "false"}
    SubElement(root, "compiler", options)
    SubElement(root, "option", {"gravity": row(lib.gravity)})
    world = SubElement(root, "worldbody")
    top = world if tree.base == WORLD else _body(model, world, tree.base, None)
    if tree.base == WORLD:
        _capsules(model, top, tree.base)
    _descend(model, top, tree.base)
    actuators = SubElement(root, "actuator")
    for j, effort in enumerate(lib.limits()["effort"]):
        _actuator(model, actuators, j, float(effort))
    add_equalities(model, root)
    indent(root, space="  ")
    takes = "Motors take torque [N m] or force [N]."
    if _has_gains(model):
        takes = "Actuators take desired positions; kp and kv are the gains of the control law."
    return xml_comment(model.robot_comment(takes)) + tostring(root, "unicode") + "\n"


def _has_gains(model: IdentifiedModel) -> bool:
    """Whether the gains of a control law are known for every joint."""
    return model.drives is not None and None not in (*model.drives.kp, *model.drives.kd)


def _actuator(model: IdentifiedModel, parent: Element, j: int, effort: float) -> None:
    """A motor, or a position actuator with the gains of the control law, within the effort."""
    name = model.lib.joint_names[j]
    limited = {"name": name, "joint": name}
    bound = {}
    if np.isfinite(effort) and effort > 0:
        bound = {"limited": "true", "range": row(np.array([-effort, effort]))}
    if model.drives is None or not _has_gains(model):
        SubElement(parent, "motor", limited | {f"ctrl{key}": v for key, v in bound.items()})
        return
    gains = {"kp": digits(model.drives.kp[j] or 0.0), "kv": digits(model.drives.kd[j] or 0.0)}
    SubElement(parent, "position", limited | gains | {f"force{k}": v for k, v in bound.items()})


def _descend(model: IdentifiedModel, parent: Element, link: str) -> None:
    for edge in model.tree.children(link):
        _descend(model, _body(model, parent, edge.child, edge), edge.child)


def _body(model: IdentifiedModel, parent: Element, link: str, edge: Edge | None) -> Element:
    body = SubElement(parent, "body", {"name": link})
    if edge is not None:
        body.attrib |= {"pos": row(edge.placement[:3, 3]), "quat": row(quaternion(edge.placement))}
    matter = model.bodies.by_link.get(link)
    if matter is not None and matter.mass > 0:
        e = matter.entries()
        full = row(np.array([e["xx"], e["yy"], e["zz"], e["xy"], e["xz"], e["yz"]]))
        inertial = {"pos": row(matter.com), "mass": digits(matter.mass), "fullinertia": full}
        SubElement(body, "inertial", inertial)
    if edge is not None and edge.kind in KINDS:
        SubElement(body, "joint", _joint(model, edge))
    _capsules(model, body, link)
    return body


def _joint(model: IdentifiedModel, edge: Edge) -> dict[str, str]:
    attributes = {"name": edge.name, "type": KINDS[edge.kind], "axis": row(edge.axis)}
    if edge.lower is not None and edge.upper is not None and edge.lower < edge.upper:
        attributes |= {"limited": "true", "range": row(np.array([edge.lower, edge.upper]))}
    if edge.name not in model.lib.joint_names:  # friction is that of the joints that it follows
        return attributes
    index, friction = model.lib.joint_names.index(edge.name), model.friction
    keys = {"damping": "damping", "frictionloss": "friction", "armature": "armature"}
    for key, quantity in keys.items():
        value = getattr(friction, quantity)[index]
        if value is not None:
            attributes[key] = digits(value)
    return attributes


def _capsules(model: IdentifiedModel, body: Element, link: str) -> None:
    is_base = link == model.tree.base
    for proxy in model.lib.proxies:
        if proxy.link == link or (is_base and proxy.link == "base"):
            ends = np.array([*proxy.start, *proxy.end])
            is_ball = bool(np.allclose(proxy.start, proxy.end, rtol=0, atol=1e-6))
            shape = {"type": "capsule", "fromto": row(ends)}
            if is_ball:
                shape = {"type": "sphere", "pos": row(ends[:3])}
            rest = {"size": digits(proxy.radius), "contype": "0", "conaffinity": "0"}
            SubElement(body, "geom", {"name": proxy.name, **shape, **rest, "group": "2"})


MJCF = ExportFormat(
    "mjcf",
    "MJCF with inertials, joint friction, rotor inertia and motors, for MuJoCo",
    "{robot}.xml",
    mjcf_text,
    partial(compare_reloaded, mujoco),
)
