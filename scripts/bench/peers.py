"""Peers that compute the same: Pinocchio from C++ and Python, MuJoCo from Python, CasADi's VM.

Every peer gets the same states and the same model, and its result for the last sample of the
batch is compared with ours before its time counts.
"""

import ctypes
import itertools
import shlex
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import platformdirs
from numpy.typing import NDArray

from bench.compiled import processor
from bench.front import BenchError
from bench.ours import Batch
from runtime.common.compiler import compiler_version, run
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


SOURCE = Path(__file__).with_name("pinocchio_bench.cpp")
FLAGS = (
    *("-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-shared", "-fPIC", "-fvisibility=hidden"),
    # the definitions that Pinocchio's own CMake package hands to its users
    *("-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_MPL_LIMIT_LIST_SIZE=30"),
    *("-DBOOST_MPL_LIMIT_VECTOR_SIZE=30", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12"),
)
INSTANCES = 4
"""Models with data of their own, measured in turn, the best one counts: with a single one, now and
then a process was a third slower at the regressor while all else was as fast as ever."""


def pinocchio_cpp(lib: Library, batch: Batch) -> Peer:
    """Pinocchio's header-only algorithms, compiled for this processor."""
    dll, detail = _compiled()
    opener = dll["peer_open"]
    opener.restype = ctypes.c_void_p
    states = [ctypes.c_void_p(x.ctypes.data) for x in (batch.q, batch.dq, batch.ddq, batch.tau)]
    model = model_text(lib).encode()
    handles = [
        ctypes.c_void_p(opener(model, ctypes.c_long(batch.size), *states)) for _ in range(INSTANCES)
    ]
    timer, n = dll["peer_run"], lib.n_joints
    timer.restype = ctypes.c_double
    order = to_pinocchio_order(np.arange(10.0 * n)).astype(int)

    def contender(algorithm: str, read: Callable[[Array], Array] | None) -> Contender:
        result = np.zeros(10 * n * n)
        turn = itertools.cycle(handles)

        def run(calls: int) -> float:
            handle, address = next(turn), ctypes.c_void_p(result.ctypes.data)
            timer(handle, algorithm.encode(), ctypes.c_long(1), address)  # this one was away
            return float(timer(handle, algorithm.encode(), ctypes.c_long(calls), address))

        return Contender(algorithm, run, None if read is None else lambda: read(result))

    def torque(result: Array) -> Array:
        return result[:n]

    def regressor(result: Array) -> Array:
        y = np.empty((n, 10 * n))
        y[:, order] = result.reshape(n, 10 * n)
        return y

    return Peer(
        detail,
        {
            "inverse_dynamics": contender("rnea", torque),
            "base_inverse_dynamics": contender("rnea", torque),
            "torque": contender("rnea", torque),
            "torque_jacobian": contender(f"{REGRESSOR} · ∂π/∂λ", None),
            "regressor": contender(REGRESSOR, regressor),
            "base_regressor": contender(REGRESSOR, lambda x: regressor(x)[:, lib.base_columns]),
            "mass_matrix": contender("crba", lambda x: x[: n * n]),
            "forward_dynamics": contender("aba", torque),
            "end_effector": contender("forwardKinematics", None),
            "loss_gradient": contender(f"{REGRESSOR}ᵀ W r", None),
        },
    )


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


def _compiled() -> tuple[ctypes.CDLL, str]:
    """The library, compiled once a minute long, and versions and command that made it."""
    compiler = next(filter(shutil.which, ("clang++", "g++")), None)
    if compiler is None:
        raise BenchError("neither clang++ nor g++ is on the PATH")
    includes, versions = _headers()
    command = (compiler, *FLAGS, *(part for path in includes for part in ("-isystem", str(path))))
    detail = f"{versions}; {compiler_version((compiler,))}; {shlex.join(command)}"
    key = SOURCE.read_text(encoding="utf-8") + detail + processor()
    target = (
        platformdirs.user_cache_path("symgen") / "bench" / f"{sha256(key.encode()).hexdigest()}.so"
    )
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as folder:
            run((*command, str(SOURCE), "-o", target.name), Path(folder))
            (Path(folder) / target.name).replace(target)  # appears whole or not at all
    return ctypes.CDLL(str(target)), detail


def _headers() -> tuple[tuple[Path, ...], str]:
    """Folders with the headers of Pinocchio, Boost and Eigen, and whose versions they are.

    Pinocchio's wheels bring Boost but not Eigen; where cmeel-eigen is not installed, the copy in
    CasADi's wheel serves.
    """
    try:
        package = distribution("libpinocchio")
    except PackageNotFoundError:
        raise BenchError("the wheel of Pinocchio (pip install pin) is not installed") from None
    prefix = Path(str(package.locate_file("cmeel.prefix"))) / "include"
    name = f"pinocchio {package.version}"
    if not (prefix / "pinocchio" / "algorithm" / "rnea.hpp").exists():
        raise BenchError(f"the installed Pinocchio brings no headers in '{prefix}'")
    eigens = [prefix / "eigen3", Path(casadi.__file__).parent / "include/eigen3"]
    for eigen in (*eigens, Path("/usr/include/eigen3")):
        if (eigen / "Eigen" / "Core").exists():
            return (prefix, eigen), name
    raise BenchError("no Eigen headers found (looked for cmeel-eigen, CasADi's copy, /usr/include)")
