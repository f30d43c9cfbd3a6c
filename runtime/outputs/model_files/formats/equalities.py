"""Equalities of MJCF for joints that follow others and for closed loops.

A joint x = f x_m + o has <joint polycoef="o f 0 0 0"/>, one with several masters a fixed tendon of
constant length o. Spherical and revolute loop joints have <connect> of one or two pairs of sites
along the axis, fixed ones <weld> of a pair.
"""

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from runtime.errors import ExportError
from runtime.library.manifest import FrameFacts, Manifest
from runtime.outputs.model_files.bodies import digits, quaternion, row
from runtime.outputs.model_files.couplings import couplings
from runtime.outputs.model_files.model import IdentifiedModel, require_loop_frames

LEVER = 0.1
"""Distance of the two points along the axis of a revolute loop joint [m]."""


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
