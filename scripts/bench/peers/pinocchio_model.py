"""Pinocchio's model of our robot in Python, and the text that the C++ program reads."""

from typing import Any
from xml.etree.ElementTree import tostring

import numpy as np
from defusedxml.ElementTree import fromstring

from bench.compiled import BenchError
from runtime.library import Array, Library


def pinocchio_model(lib: Library) -> tuple[Any, list[int]]:
    """Pinocchio's model of the robot and its joints' indices in our order."""
    try:
        import pinocchio
    except ImportError:
        raise BenchError("the wheel of Pinocchio (pip install pin) is not installed") from None
    robot = fromstring(lib.urdf())
    for joint in robot.iter("joint"):
        if joint.get("type") == "continuous":  # two numbers per joint there, one here
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = joint.makeelement("limit", {}) if limit is None else limit
            joint.append(limit)
            limit.attrib.update(lower="-9", upper="9", effort="1", velocity="1")
    model = pinocchio.buildModelFromXML(tostring(robot, "unicode"))
    model.gravity.linear = lib.gravity
    return model, [model.getJointId(name) for name in lib.joint_names]


def model_text(lib: Library) -> str:
    """The model as pinocchio_bench.cpp reads it, joints in our order."""
    model, ids = pinocchio_model(lib)
    place = {index: k + 1 for k, index in enumerate(ids)} | {0: 0}
    lines = [_numbers(model.gravity.linear)]
    for index, facts in zip(ids, lib.manifest.joints, strict=True):
        joint, placement = model.joints[index], model.jointPlacements[index]
        axis = _axis(model, index)
        inertia = model.inertias[index].toDynamicParameters()
        numbers = (axis, placement.rotation.ravel(), placement.translation, inertia)
        if joint.nq != 1 or model.parents[index] not in place:
            raise BenchError(
                f"expected a joint of one coordinate after its parent, got '{facts.name}'; "
                "time this robot without Pinocchio in C++"
            )
        shown = " ".join(_numbers(part) for part in numbers)
        lines.append(f"{place[model.parents[index]]} {joint.shortname()} {shown}")
    return "\n".join(lines)


def _axis(model: Any, index: int) -> Array:
    """Axis of a one-dimensional joint in its own frame: its motion subspace at q = 0."""
    import pinocchio

    data = model.createData()
    pinocchio.computeJointJacobians(model, data, np.zeros(model.nq))
    column = pinocchio.getJointJacobian(model, data, index, pinocchio.LOCAL)
    motion = column[:, model.joints[index].idx_v]
    return motion[3:] if np.linalg.norm(motion[3:]) > 0.5 else motion[:3]


def _numbers(values: Array) -> str:
    return " ".join(f"{x:.17g}" for x in values)
