"""Equalities `connect` and `weld` of MJCF → loop joints.

    connect   a point of body 1 stays at a point of body 2          spherical
    weld      a frame of body 1 stays at a frame of body 2          fixed

MuJoCo's compiler computes points and frames that are not stated from the initial pose, at which
every joint is at its reference: that is the assembly pose.
"""

from typing import Any

import numpy as np
import pinocchio

from symgen.chain.mechanism import Loop
from symgen.errors import BuildError


def loop_of_equality(
    mujoco: Any, model: Any, k: int, names: list[str], shifts: dict[int, np.ndarray]
) -> Loop:
    """Loop joint of an equality."""
    kind, data = int(model.eq_type[k]), np.array(model.eq_data[k])
    kinds = {int(mujoco.mjtEq.mjEQ_CONNECT): "spherical", int(mujoco.mjtEq.mjEQ_WELD): "fixed"}
    if kind not in kinds:
        raise BuildError(
            f"the equality {k + 1} of the file is none of joint, connect and weld; tendons and "
            "flexes of MJCF cannot be modelled, so remove it, or state [[coupling]] in a mechanism "
            "file"
        )
    first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
    turn, other = np.eye(3), np.eye(3)
    if int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
        (first, at, turn), (second, to, other) = (
            (int(model.site_bodyid[s]), model.site_pos[s], _matrix(mujoco, model.site_quat[s]))
            for s in (first, second)
        )
    elif kinds[kind] == "fixed":  # the pose of body 2 in body 1, of a point given in body 2
        at, to, turn = data[3:6], data[:3], _matrix(mujoco, data[6:10])
    else:
        at, to = data[:3], data[3:6]
    at, to = at - shifts[first], to - shifts[second]
    return Loop(
        names[first],
        names[second],
        tuple(at.tolist()),
        tuple(pinocchio.rpy.matrixToRpy(turn).tolist()),
        tuple(to.tolist()),
        tuple(pinocchio.rpy.matrixToRpy(other).tolist()),
        kinds[kind],
    )


def assembly_of(model: Any) -> dict[str, float]:
    """Joint → position of the initial pose [rad, m], joints at 0 left out."""
    positions = {}
    for k in range(model.njnt):
        value = float(model.qpos0[model.jnt_qposadr[k]])
        if value:
            positions[model.joint(k).name or f"joint_{k}"] = value
    return positions


def _matrix(mujoco: Any, quaternion: Any) -> np.ndarray:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array(quaternion, dtype=float))
    return matrix.reshape(3, 3)
