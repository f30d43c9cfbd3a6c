"""Peers that compute the same: Pinocchio and MuJoCo from Python, CasADi's VM.

Every peer gets the same states and the same model, and its result for the last sample of the
batch is compared with ours before its time counts. `pinocchio_cpp` is one more.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.batch import Batch
from bench.front import BenchError
from runtime.library import Array, Library, to_pinocchio_order

REGRESSOR = "computeJointTorqueRegressor"


@dataclass(frozen=True, slots=True)
class Contender:
    """One algorithm of a peer for one of our kernels."""

    algorithm: str  # what it is called there
    run: Callable[[int], float]  # (calls) → ns per sample over the batch
    last: Callable[[], Array] | None = None  # answer for the last sample, our order


@dataclass(frozen=True, slots=True)
class Peer:
    """A library, and its algorithms by the name of our kernel."""

    detail: str
    contenders: dict[str, Contender]


def repeated(one: Callable[[], object], samples: int, times: int = 1) -> Callable[[int], float]:
    """Times a Python call that is repeated `times` times for a batch of `samples`."""

    def run(calls: int) -> float:
        start = time.perf_counter_ns()
        for _ in range(calls * times):
            one()
        return (time.perf_counter_ns() - start) / (calls * samples)

    return run


def one_by_one(batch: Batch, one: Callable[..., object], *arrays: Array) -> Callable[[int], float]:
    """Times a Python call per sample, the loop included."""
    rows = list(zip(*(list(x) for x in arrays), strict=True))

    def every() -> None:
        for row in rows:
            one(*row)

    return repeated(every, batch.size)


def pinocchio_model(lib: Library) -> tuple[Any, list[int]]:
    """Pinocchio's model of the robot and its joints' indices in our order."""
    try:
        from tests import oracle
    except ImportError:
        raise BenchError("the wheel of Pinocchio (pip install pin) is not installed") from None
    model = oracle.pinocchio_model(lib.urdf(), lib.gravity)
    return model, [model.getJointId(name) for name in lib.joint_names]


def pinocchio_in_order(lib: Library) -> tuple[Any, Any, list[int], Array, Array]:
    """Pinocchio, model and joints; places of our joints in its order, and of its in ours."""
    model, ids = pinocchio_model(lib)
    import pinocchio

    columns = np.array([model.joints[i].idx_v for i in ids])
    return pinocchio, model, ids, columns, np.argsort(columns)


def pinocchio_python(lib: Library, batch: Batch) -> Peer:
    """The same algorithms through Pinocchio's Python interface, one call per sample."""
    pin, model, _, columns, order = pinocchio_in_order(lib)
    data = model.createData()
    q, dq, ddq, tau = (x[:, order] for x in (batch.q, batch.dq, batch.ddq, batch.tau))
    motion = (q, dq, ddq)

    def contender(algorithm: str, *arrays: Array, last: Callable[[], Array] | None) -> Contender:
        function = getattr(pin, algorithm)
        return Contender(
            f"pin.{algorithm}",
            one_by_one(batch, lambda *row: function(model, data, *row), *arrays),
            last,
        )

    rnea = contender("rnea", *motion, last=lambda: data.tau[columns])
    regressor = contender(REGRESSOR, *motion, last=None)
    return Peer(
        f"pin {version('pin')}",
        {
            "inverse_dynamics": rnea,
            "base_inverse_dynamics": rnea,
            "torque": rnea,
            "regressor": regressor,
            "base_regressor": regressor,
            "mass_matrix": contender("crba", q, last=None),
            "forward_dynamics": contender(
                "aba",
                q,
                dq,
                tau,
                last=lambda: pin.aba(model, data, q[-1], dq[-1], tau[-1])[columns],
            ),
            "end_effector": contender("forwardKinematics", q, last=None),
        },
    )


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


def casadi_vm(functions: dict[str, tuple[Any, tuple[str, ...]]], batch: Batch) -> Peer:
    """Expressions of our C code in CasADi's virtual machine; one sample, repeated."""

    def contender(function: Any, names: tuple[str, ...]) -> Contender:
        buffer, trigger = function.buffer()
        arrays = [batch.named(name) for name in names]
        inputs = [np.array(x[-1] if x.ndim == 2 else x) for x in arrays]
        outputs = [np.zeros(function.numel_out(k)) for k in range(function.n_out())]
        for k, x in enumerate(inputs):
            buffer.set_arg(k, x.data)
        for k, x in enumerate(outputs):
            buffer.set_res(k, x.data)

        # The trigger holds only addresses.
        def last(_kept: object = (buffer, inputs)) -> Array:
            return outputs[-1]

        return Contender("Function", repeated(trigger, batch.size, batch.size), last)

    contenders = {name: contender(f, names) for name, (f, names) in functions.items()}
    return Peer(f"casadi {version('casadi')}", contenders)


def oracle(lib: Library, batch: Batch) -> dict[str, Array]:
    """Pinocchio's results for every kernel, (N, size), in our order of joints and parameters.

    ∂τ/∂λ is Pinocchio's regressor times ∂π/∂λ of the library, link by link; the residual of the
    loss is Pinocchio's torque less the measured one.
    """
    pin, model, _, columns, order = pinocchio_in_order(lib)
    from tests.oracle import answers_at

    data, n = model.createData(), batch.size
    a = answers_at(model, lib, batch.q, batch.dq, batch.ddq)
    y = np.empty_like(a.regressor)
    y[..., to_pinocchio_order(np.arange(10.0 * lib.n_links)).astype(int)] = a.regressor
    by_link = np.einsum(
        "njlk,lkm->njlm", y.reshape(n, -1, lib.n_links, 10), lib.pi_jacobian(batch.lam)
    )
    states = zip(batch.q[:, order], batch.dq[:, order], batch.tau[:, order], strict=True)
    results = {
        **dict.fromkeys(("inverse_dynamics", "base_inverse_dynamics", "torque"), a.tau),
        "loss_gradient": a.tau - batch.tau,
        "regressor": y,
        "base_regressor": y[..., list(lib.base_columns)],
        "torque_jacobian": by_link,
        "mass_matrix": a.mass,
        "forward_dynamics": np.array([pin.aba(model, data, *x)[columns] for x in states]),
        "end_effector": a.pose,
    }
    return {name: rows.reshape(n, -1) for name, rows in results.items()}


def parameter_order(ids: list[int]) -> NDArray[np.intp]:
    """Columns of Pinocchio's regressor in our order, for its joints `ids`."""
    ours = np.argsort(to_pinocchio_order(np.arange(10.0)))
    return np.concatenate([10 * (i - 1) + ours for i in ids])


def deviation(ours: Array, theirs: Array) -> float:
    """Largest difference over all samples, relative to the largest entry of its sample."""
    scale = np.maximum(np.abs(theirs).max(axis=1), 1e-300)
    return float((np.abs(ours - theirs).max(axis=1) / scale).max())
