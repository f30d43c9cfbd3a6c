"""Read MJCF by MuJoCo: mj_inverse with damping and armature, without constraints.

Torques of joints that follow others are projected, τ = Gᵀ τ_all, and the equalities are compared
with G.
"""

from typing import Any

import numpy as np

from runtime.library import Array, Library
from runtime.outputs.model_files.engines.answer import STATES, Reloaded, Unreadable, random_states

INSTALL = "pip install mujoco"
CLOSED_STATES = 20  # states at which equalities are checked
CLOSED, RANK = 1e-8, 1e-6  # rounding of equalities [m, rad] and slopes; least singular value


def parsed(text: str) -> Any:
    """Specification of an MJCF, `mujoco.MjSpec`; None without MuJoCo."""
    try:
        import mujoco
    except ImportError:
        return None
    return mujoco.MjSpec.from_string(text)


def reload(text: str, lib: Library, count: int = STATES) -> Reloaded | None:
    """Read an MJCF by MuJoCo."""
    try:
        import mujoco
    except ImportError:
        return None
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise Unreadable(error) from None
    names = tuple(model.joint(k).name for k in range(model.njnt))
    expected = lib.all_joint_names
    if set(names) != set(expected) or model.nv != len(expected):
        raise Unreadable(f"expected the joints {', '.join(expected)}, got {', '.join(names)}")
    every = [int(model.joint(name).dofadr[0]) for name in expected]
    order = [int(model.joint(name).dofadr[0]) for name in lib.joint_names]
    data, states = mujoco.MjData(model), random_states(lib, count)
    q, dq, ddq = states
    is_coupled = expected != lib.joint_names
    motion = lib.all_motion(q, dq, ddq) if is_coupled else states
    if is_coupled:
        _require_equalities(mujoco, model, data, lib, q[:CLOSED_STATES], every)
    # Contacts and dry friction are constraints, which are not part of the inverse dynamics.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    tau = np.empty_like(motion[0])
    for k, rows in enumerate(zip(*motion, strict=True)):
        data.qpos[every], data.qvel[every], data.qacc[every] = rows
        mujoco.mj_inverse(model, data)
        tau[k] = data.qfrc_inverse[every]
    if is_coupled:
        tau = np.einsum("nkj,nk->nj", lib.joint_jacobian(q), tau)
    damping, friction, armature = (
        np.array(values)[order].reshape(lib.n_joints, -1)[:, 0]
        for values in (model.dof_damping, model.dof_frictionloss, model.dof_armature)
    )
    return Reloaded(
        f"MuJoCo {mujoco.__version__}",
        tau - damping * dq - armature * ddq,
        damping=damping,
        friction=friction,
        armature=armature,
    )


def _require_equalities(
    mujoco: Any, model: Any, data: Any, lib: Library, q: Array, order: list[int]
) -> None:
    """Raise Unreadable unless residual, slope along G and rank leave the library's motions."""
    for positions, jacobian in zip(lib.all_positions(q), lib.joint_jacobian(q), strict=True):
        data.qpos[order] = positions
        mujoco.mj_forward(model, data)
        kept = np.asarray(data.efc_type) == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        if mujoco.mj_isSparse(model):
            slope = np.zeros((data.nefc, model.nv))
            mujoco.mju_sparse2dense(
                slope, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
            )
        else:
            slope = np.reshape(data.efc_J, (data.nefc, model.nv))
        slope = slope[kept][:, order]
        residual = np.abs(np.asarray(data.efc_pos)[kept]).max(initial=0.0)
        along = np.abs(slope @ jacobian).max(initial=0.0)
        rank = int(np.linalg.matrix_rank(slope, tol=RANK)) if len(slope) else 0
        if max(residual, along) > CLOSED or rank != model.nv - lib.n_joints:
            raise Unreadable(
                f"its equalities leave other motions: residual {residual:.1e}, slope {along:.1e}, "
                f"rank {rank} instead of {model.nv - lib.n_joints}"
            )
