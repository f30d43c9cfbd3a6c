"""MuJoCo's inverse dynamics from Python, one call per sample."""

from importlib.metadata import version

import numpy as np

from bench.batch import Batch
from bench.compiled import BenchError
from bench.peers.peer import Contender, Peer, one_by_one
from runtime.library import Array, Library


def mujoco_python(lib: Library, batch: Batch) -> Peer:
    """`mj_inverse` without contacts and constraints, one call per sample from Python."""
    try:
        import mujoco
    except ImportError:
        raise BenchError("mujoco is not installed") from None
    try:
        model = mujoco.MjModel.from_xml_string(lib.urdf())
        joints = [model.joint(name) for name in lib.joint_names]
    except (ValueError, KeyError) as error:
        raise BenchError(f"MuJoCo refuses the URDF ({str(error).splitlines()[0]})") from None
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CONTACT) | int(off.mjDSBL_CONSTRAINT)
    model.opt.gravity[:] = lib.gravity
    data = mujoco.MjData(model)
    columns = np.array([int(joint.dofadr[0]) for joint in joints])
    order = np.empty(lib.n_joints, dtype=int)
    order[columns] = np.arange(lib.n_joints)
    qpos, qvel, qacc, inverse = data.qpos, data.qvel, data.qacc, mujoco.mj_inverse

    def one(q: Array, dq: Array, ddq: Array) -> None:
        qpos[:], qvel[:], qacc[:] = q, dq, ddq
        inverse(model, data)

    arrays = (x[:, order] for x in (batch.q, batch.dq, batch.ddq))
    contender = Contender(
        "mj_inverse", one_by_one(batch, one, *arrays), lambda: data.qfrc_inverse[columns]
    )
    names = ("inverse_dynamics", "base_inverse_dynamics", "torque")
    return Peer(f"mujoco {version('mujoco')}", dict.fromkeys(names, contender))
