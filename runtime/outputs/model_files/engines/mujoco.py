"""Read MJCF by MuJoCo: mj_inverse with damping and armature, without constraints."""

from typing import Any

import numpy as np

from runtime.library import Array, Library
from runtime.outputs.model_files.bodies import RigidBody
from runtime.outputs.model_files.engines.answer import (
    STATES,
    Reloaded,
    Unreadable,
    pi_of,
    random_states,
)

INSTALL = "pip install mujoco"


def reload(text: str, lib: Library, count: int = STATES) -> Reloaded | None:
    """Read an MJCF by MuJoCo.

    Args:
        text: the file.
        lib: the robot.
        count: number of random states of the torques.

    Returns:
        What MuJoCo read; None where it is not installed.

    Raises:
        Unreadable: MuJoCo refuses the file, or its joints differ from the library's.
    """
    try:
        import mujoco
    except ImportError:
        return None
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise Unreadable(error) from None
    names = tuple(model.joint(k).name for k in range(model.njnt))
    if set(names) != set(lib.joint_names) or model.nv != lib.n_joints:
        raise Unreadable(
            f"expected the joints {', '.join(lib.joint_names)}, got {', '.join(names)}"
        )
    # Contacts and dry friction are constraints, which are not part of the inverse dynamics.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    order = [int(model.joint(name).dofadr[0]) for name in lib.joint_names]
    data, states = mujoco.MjData(model), random_states(lib, count)
    tau = np.empty_like(states[0])
    for k, rows in enumerate(zip(*states, strict=True)):
        data.qpos[order], data.qvel[order], data.qacc[order] = rows
        mujoco.mj_inverse(model, data)
        tau[k] = data.qfrc_inverse[order]
    _, dq, ddq = states
    damping, friction, armature = (
        np.array(values)[order].reshape(lib.n_joints, -1)[:, 0]
        for values in (model.dof_damping, model.dof_frictionloss, model.dof_armature)
    )
    return Reloaded(
        f"MuJoCo {mujoco.__version__}",
        tau - damping * dq - armature * ddq,
        _parameters(mujoco, model, lib),
        damping=damping,
        friction=friction,
        armature=armature,
    )


def _parameters(mujoco: Any, model: Any, lib: Library) -> Array:
    """π (n, 10) of the moving links with the bodies that are welded to them."""
    joint_body = {int(model.joint(name).bodyid[0]): k for k, name in enumerate(lib.joint_names)}
    P = np.zeros((lib.n_joints, 4, 4))
    for body in range(1, model.nbody):
        carrier = int(model.body_weldid[body])
        if carrier == 0:
            continue
        T, at = np.eye(4), body
        while at != carrier:
            T = _placement(mujoco, model.body_pos[at], model.body_quat[at]) @ T
            at = int(model.body_parentid[at])
        principal = _placement(mujoco, model.body_ipos[body], model.body_iquat[body])
        inertia = principal[:3, :3] @ np.diag(model.body_inertia[body]) @ principal[:3, :3].T
        matter = RigidBody(float(model.body_mass[body]), principal[:3, 3], inertia)
        P[joint_body[carrier]] += T @ matter.pseudo_inertia @ T.T
    return np.array([pi_of(each) for each in P])


def _placement(mujoco: Any, position: Array, quaternion: Array) -> Array:
    rotation, T = np.empty(9), np.eye(4)
    mujoco.mju_quat2Mat(rotation, quaternion)
    T[:3, :3], T[:3, 3] = rotation.reshape(3, 3), position
    return T
