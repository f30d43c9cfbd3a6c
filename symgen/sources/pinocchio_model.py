"""`pinocchio.Model` → URDF: one link per joint, with all bodies that Pinocchio has fixed to it.

The link of a joint has the name of its first body frame. A free flyer at the root is the free base.
Other frames, rotors and friction are left out.
"""

from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio

from symgen.errors import BuildError


def urdf_of_model(model: Any) -> tuple[str, bool]:
    """Text of the URDF, and whether its base is free."""
    floats = model.njoints > 1 and model.joints[1].shortname() == "JointModelFreeFlyer"
    base, links, data = int(floats), _links(model), model.createData()
    pinocchio.forwardKinematics(model, data, pinocchio.neutral(model), np.zeros(model.nv))
    robot = Element("robot", {"name": model.name or "robot"})
    for k in range(base, model.njoints):
        _add_link(robot, links[k], model.inertias[k])
    for k in range(base + 1, model.njoints):
        if model.joints[k].nv != 1 or model.parents[k] < base:
            raise BuildError(
                f"expected joints of one axis behind the root, got '{model.names[k]}' "
                f"({model.joints[k].shortname()}); give several joints of one axis for it"
            )
        axis = np.ravel(data.joints[k].S)
        _add_joint(robot, model, k, (links[model.parents[k]], links[k]), axis)
    indent(robot, space="  ")
    return tostring(robot, "unicode") + "\n", floats


def _links(model: Any) -> list[str]:
    """Names of the links of all joints, the world's first."""
    names: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY:
            names.setdefault(frame.parentJoint, frame.name)
    return [names.get(k, f"{name}_link") for k, name in enumerate(model.names)]


def _add_link(robot: Element, name: str, inertia: Any) -> None:
    link = SubElement(robot, "link", {"name": name})
    if not inertia.mass > 0:
        return
    element = SubElement(link, "inertial")
    SubElement(element, "origin", {"xyz": _text(inertia.lever), "rpy": "0 0 0"})
    SubElement(element, "mass", {"value": repr(float(inertia.mass))})
    pairs = zip("xxxyyz", "xyzyzz", *np.triu_indices(3), strict=True)
    entries = {f"i{a}{b}": repr(float(inertia.inertia[i, j])) for a, b, i, j in pairs}
    SubElement(element, "inertia", entries)


def _add_joint(robot: Element, model: Any, k: int, ends: tuple[str, str], axis: np.ndarray) -> None:
    joint, place = model.joints[k], model.jointPlacements[k]
    slides = not axis[3:].any()
    limits = {"effort": model.upperEffortLimit, "velocity": model.upperVelocityLimit}
    values = {key: limit[joint.idx_v] for key, limit in limits.items()}
    if joint.nq == 1:  # the two coordinates of a continuous joint are cos q and sin q
        values["lower"] = model.lowerPositionLimit[joint.idx_q]
        values["upper"] = model.upperPositionLimit[joint.idx_q]
    finite = {key: repr(float(x)) for key, x in values.items() if abs(x) < _UNLIMITED}
    kind = "prismatic" if slides else "revolute" if "lower" in finite else "continuous"
    element = SubElement(robot, "joint", {"name": model.names[k], "type": kind})
    rpy = pinocchio.rpy.matrixToRpy(place.rotation)
    SubElement(element, "origin", {"xyz": _text(place.translation), "rpy": _text(rpy)})
    SubElement(element, "parent", {"link": ends[0]})
    SubElement(element, "child", {"link": ends[1]})
    SubElement(element, "axis", {"xyz": _text(axis[:3] if slides else axis[3:])})
    SubElement(element, "limit", {"effort": "0", "velocity": "0"} | finite)  # 0: not given


_UNLIMITED = 1e9
"""Limits from here on are none: libraries write the largest number."""


def _text(numbers: Any) -> str:
    return " ".join(repr(float(x)) for x in numbers)
