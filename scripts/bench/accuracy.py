"""Deviation of every kernel from Pinocchio, over the whole batch."""

import numpy as np
from numpy.typing import NDArray

from bench.batch import Batch
from bench.peers import pinocchio_model
from runtime.library import Array, Library


def oracle(lib: Library, batch: Batch) -> dict[str, Array]:
    """Pinocchio's results for every kernel, (N, size), in our order of joints and parameters.

    ∂τ/∂λ is Pinocchio's regressor times ∂π/∂λ of the library, link by link; the residual of the
    loss is Pinocchio's torque less the measured one.
    """
    model, ids = pinocchio_model(lib)
    import pinocchio as pin

    data, n = model.createData(), lib.n_joints
    columns = np.array([model.joints[i].idx_v for i in ids])
    order = np.empty(n, dtype=int)
    order[columns] = np.arange(n)
    parameters = parameter_order(ids)
    base, tip = (model.getFrameId(name) for name in (lib.manifest.base, lib.manifest.tip))
    blocks = lib.pi_jacobian(batch.lam)
    results: dict[str, list[Array]] = {}

    def enter(name: str, value: Array) -> None:
        results.setdefault(name, []).append(np.ravel(value).copy())

    for q, dq, ddq, tau in zip(batch.q, batch.dq, batch.ddq, batch.tau, strict=True):
        state = (q[order], dq[order], ddq[order])
        torque = pin.rnea(model, data, *state)[columns].copy()
        for name in ("inverse_dynamics", "base_inverse_dynamics", "torque"):
            enter(name, torque)
        enter("loss_gradient", torque - tau)
        y = pin.computeJointTorqueRegressor(model, data, *state)[columns][:, parameters]
        enter("regressor", y)
        enter("base_regressor", y[:, lib.base_columns])
        by_link = y.reshape(n, n, 10).transpose(1, 0, 2) @ blocks
        enter("torque_jacobian", by_link.transpose(1, 0, 2))
        mass = np.triu(pin.crba(model, data, q[order]))
        mass = mass + np.triu(mass, 1).T
        enter("mass_matrix", mass[np.ix_(columns, columns)])
        enter("forward_dynamics", pin.aba(model, data, *state[:2], tau[order])[columns])
        pin.framesForwardKinematics(model, data, q[order])
        enter("end_effector", data.oMf[base].actInv(data.oMf[tip]).homogeneous)
    return {name: np.array(rows) for name, rows in results.items()}


_OUR_ORDER = np.array([0, 1, 2, 3, 4, 6, 9, 5, 7, 8])
"""[m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ] among [m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]."""


def parameter_order(ids: list[int]) -> NDArray[np.intp]:
    """Columns of Pinocchio's regressor in our order, for its joints `ids`."""
    return np.concatenate([10 * (i - 1) + _OUR_ORDER for i in ids])


def deviation(ours: Array, theirs: Array) -> float:
    """Largest difference over all samples, relative to the largest entry of its sample."""
    scale = np.maximum(np.abs(theirs).max(axis=1), 1e-300)
    return float((np.abs(ours - theirs).max(axis=1) / scale).max())
