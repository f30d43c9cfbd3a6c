"""Pinocchio's answer for a generated robot: same URDF, joints matched by name."""

from dataclasses import dataclass
from xml.etree.ElementTree import SubElement, tostring

import numpy as np
import pinocchio
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray

from runtime.library import Library, to_pinocchio_order

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Answers:
    """States (N, n) and what Pinocchio says about them; Y in Pinocchio's parameter order."""

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    bias: Array
    regressor: Array
    mass: Array
    pose: Array
    links: Array


def pinocchio_model(urdf: str, gravity: Array | None = None) -> pinocchio.Model:
    """Model of a URDF; `continuous` becomes unlimited revolute so that nq = nv.

    Friction plays no part, and where it is negative Pinocchio refuses the file.
    """
    robot = fromstring(urdf)
    for joint in robot.iter("joint"):
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            if joint.find("limit") is None:
                SubElement(joint, "limit")
            joint.find("limit").attrib.update(lower="-9", upper="9", effort="1", velocity="1")
    model = pinocchio.buildModelFromXML(tostring(robot, "unicode"))
    if gravity is not None:
        model.gravity.linear = gravity
    return model


def with_parameters(model: pinocchio.Model, lib: Library, pi: Array) -> pinocchio.Model:
    """The model with the inertias of π, link by link."""
    model = model.copy()
    blocks = to_pinocchio_order(pi).reshape(-1, 10)
    for name, block in zip(lib.joint_names, blocks, strict=True):
        inertia = pinocchio.Inertia.FromDynamicParameters(block)
        model.inertias[model.getJointId(name)] = inertia
    return model


def random_states(n: int, count: int, seed: int) -> tuple[Array, Array, Array]:
    """Positions all around, brisk velocities and accelerations."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (count, n))
    return q, rng.normal(0, 2, (count, n)), rng.normal(0, 5, (count, n))


def ask_pinocchio(model: pinocchio.Model, lib: Library, count: int, seed: int = 0) -> Answers:
    """Everything at `count` random states, in the joint order of the library."""
    return answers_at(model, lib, *random_states(lib.n_joints, count, seed))


def answers_at(model: pinocchio.Model, lib: Library, q: Array, dq: Array, ddq: Array) -> Answers:
    """Everything at states (N, n), in the joint order of the library."""
    ids = [model.getJointId(name) for name in lib.joint_names]
    columns = np.array([model.joints[i].idx_v for i in ids])
    blocks = np.concatenate([np.arange(10 * (i - 1), 10 * i) for i in ids])
    frame = model.getFrameId(lib.manifest.tip, pinocchio.BODY)
    data = model.createData()
    tau, bias, rows, mass, pose, links = [], [], [], [], [], []
    for state in zip(q, dq, ddq, strict=True):
        x, v, a = (np.empty(len(columns)) for _ in range(3))
        x[columns], v[columns], a[columns] = state
        tau.append(pinocchio.rnea(model, data, x, v, a)[columns])
        bias.append(pinocchio.nonLinearEffects(model, data, x, v)[columns])
        y = pinocchio.computeJointTorqueRegressor(model, data, x, v, a)
        rows.append(y.reshape(model.nv, -1)[np.ix_(columns, blocks)])
        upper = np.triu(pinocchio.crba(model, data, x))
        full = upper + np.triu(upper, 1).T  # crba leaves the lower triangle undefined
        mass.append(full[np.ix_(columns, columns)])
        pinocchio.framesForwardKinematics(model, data, x)
        pose.append(data.oMf[frame].homogeneous.copy())
        links.append([data.oMi[i].homogeneous.copy() for i in ids])
    known = (tau, bias, rows, mass, pose, links)
    return Answers(q, dq, ddq, *map(np.array, known))
