"""Read URDF by pinocchio: rnea of the parsed model."""

from types import ModuleType
from typing import Any
from xml.etree.ElementTree import SubElement, tostring

import numpy as np
from defusedxml.ElementTree import fromstring

from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.outputs.model_files.engines.answer import STATES, Reloaded, Unreadable, random_states

INSTALL = "pip install pin"


def parsed(text: str, lib: Library) -> Any:
    """Model of a URDF with the gravity of a library; None without pinocchio."""
    pinocchio = _pinocchio()
    if pinocchio is None:
        return None
    try:
        root = (pinocchio.JointModelFreeFlyer(),) if lib.manifest.floating else ()
        model = pinocchio.buildModelFromXML(_with_limits(text), *root)
    except (ValueError, RuntimeError) as error:
        raise Unreadable(error) from None
    model.gravity.linear = lib.gravity
    return model


def reload(text: str, lib: Library, count: int = STATES) -> Reloaded | None:
    """Read a URDF by pinocchio."""
    pinocchio, model = _pinocchio(), parsed(text, lib)
    if pinocchio is None:
        return None
    names = tuple(model.names[1 + lib.manifest.floating :])
    if set(names) != set(lib.all_joint_names):
        listed, read = (", ".join(each) for each in (lib.all_joint_names, names))
        raise Unreadable(f"expected the joints {listed}, got {read}")
    joints = [model.joints[model.getJointId(name)] for name in lib.all_joint_names]
    velocity = [model.joints[model.getJointId(name)].idx_v for name in lib.joint_names]
    return Reloaded(
        f"pinocchio {pinocchio.__version__}",
        _torques(pinocchio, model, lib, joints, count),
        damping=np.asarray(model.damping)[velocity],
        friction=np.asarray(model.friction)[velocity],
    )


def _pinocchio() -> ModuleType | None:
    try:
        import pinocchio
    except ImportError:
        return None
    # The package index has a test runner of the same name, which reads no models.
    return pinocchio if hasattr(pinocchio, "buildModelFromXML") else None


def _with_limits(text: str) -> str:
    """The same URDF with the <limit> that pinocchio's parser requires where there is none."""
    root = fromstring(text, forbid_dtd=True)
    for joint in root.findall("joint"):
        if joint.get("type") in {"revolute", "prismatic"} and joint.find("limit") is None:
            SubElement(joint, "limit", {"effort": "1", "velocity": "1"})
    return tostring(root, "unicode")


def _torques(pinocchio: Any, model: Any, lib: Library, joints: list[Any], count: int) -> Array:
    """τ of the reloaded model for the independent joints, (N, n); all joints matched by name."""
    data = model.createData()
    velocity = [joint.idx_v for joint in joints]
    states = random_states(lib, count)
    base = FREEDOM if lib.manifest.floating else 0  # the free flyer has the first six velocities
    q, dq, ddq = lib.all_motion(*(each[:, base:] for each in states))
    position = np.tile(pinocchio.neutral(model), (count, 1))
    v, a = np.zeros((2, count, model.nv))
    for k in range(count if base else 0):
        turn = pinocchio.Quaternion(pinocchio.exp3(states[0][k, 3:base])).coeffs()
        position[k, : base + 1] = np.concatenate([states[0][k, :3], turn])
    v[:, :base], a[:, :base] = states[1][:, :base], states[2][:, :base]
    v[:, velocity], a[:, velocity] = dq, ddq
    for joint, angle in zip(joints, q.T, strict=True):
        # Trap: pinocchio describes a continuous joint by cos q and sin q.
        circle = (np.cos(angle), np.sin(angle)) if joint.nq == 2 else (angle,)
        position[:, joint.idx_q : joint.idx_q + joint.nq] = np.stack(circle, axis=1)
    rows = zip(position, v, a, strict=True)
    every = np.array([pinocchio.rnea(model, data, *row) for row in rows])
    tau, wrench = every[:, velocity], every[:, :base]
    jacobian = lib.joint_jacobian(states[0][:, base:])
    return np.hstack([wrench, np.einsum("tk,tkn->tn", tau, jacobian)])
