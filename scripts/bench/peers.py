"""Who else computes the same: Pinocchio in C++ and from Python, MuJoCo, CasADi's VM, NumPy.

Every peer gets the same states and the same model, and its result for the last sample of the
batch is compared with ours before its time counts.
"""

import ctypes
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring

import numpy as np
from defusedxml.ElementTree import fromstring

from bench.batch import Batch
from bench.compiled import BenchError, compile_shared, find, open_shared
from runtime.library import Array, Library, to_pinocchio_order

REGRESSOR = "computeJointTorqueRegressor"


@dataclass(frozen=True, slots=True)
class Contender:
    """One algorithm of a peer for one of our kernels.

    Attributes:
        algorithm: what it is called there.
        run: (calls) → ns per sample over the batch.
        last: its answer for the last sample, in our order, or None where there is nothing alike.
    """

    algorithm: str
    run: Callable[[int], float]
    last: Callable[[], Array] | None = None


@dataclass(frozen=True, slots=True)
class Peer:
    """A library: what it is, and its contenders by the name of our kernel."""

    detail: str
    contenders: dict[str, Contender]


def pinocchio_cpp(lib: Library, batch: Batch) -> Peer:
    """Pinocchio's header-only algorithms, compiled for this processor.

    Raises:
        BenchError: it cannot be built here; says why.
    """
    compiler = find(("clang++", "g++"))
    includes, versions = _headers()
    flags = (
        "-std=c++17",
        "-O3",
        "-march=native",
        "-DNDEBUG",
        # the definitions that Pinocchio's own CMake package hands to its users
        "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
        "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
        "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
        "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
        *(part for path in includes for part in ("-isystem", str(path))),
    )
    source = (Path(__file__).parent / "pinocchio_bench.cpp").read_text(encoding="utf-8")
    path, command = compile_shared(compiler, flags, source, ".cpp", versions)
    dll = open_shared(path)
    opener = dll["peer_open"]
    opener.restype = ctypes.c_void_p
    handle = ctypes.c_void_p(
        opener(
            _model_text(lib).encode(),
            ctypes.c_long(batch.size),
            *(ctypes.c_void_p(x.ctypes.data) for x in (batch.q, batch.dq, batch.ddq, batch.tau)),
        )
    )
    timer, n = dll["peer_run"], lib.n_joints
    timer.restype = ctypes.c_double
    order = to_pinocchio_order(np.arange(10.0 * n)).astype(int)

    def contender(algorithm: str, read: Callable[[Array], Array] | None) -> Contender:
        result = np.zeros(10 * n * n)

        def run(calls: int) -> float:
            address = ctypes.c_void_p(result.ctypes.data)
            return float(timer(handle, algorithm.encode(), ctypes.c_long(calls), address))

        return Contender(algorithm, run, None if read is None else lambda: read(result))

    def torque(result: Array) -> Array:
        return result[:n]

    def regressor(result: Array) -> Array:
        y = np.empty((n, 10 * n))
        y[:, order] = result.reshape(n, 10 * n)
        return y

    return Peer(
        f"{versions}; {compiler.version}; {command}",
        {
            "inverse_dynamics": contender("rnea", torque),
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
    eigens = [prefix / "eigen3", Path("/usr/include/eigen3")]
    try:
        import casadi

        eigens.insert(1, Path(casadi.__file__).parent / "include" / "eigen3")
    except ImportError:
        pass
    for eigen in eigens:
        if (eigen / "Eigen" / "Core").exists():
            return (prefix, eigen), f"{name}, Eigen {_eigen_version(eigen)}"
    raise BenchError("no Eigen headers found (looked for cmeel-eigen, CasADi's copy, /usr/include)")


def _eigen_version(folder: Path) -> str:
    text = "".join(
        path.read_text(encoding="utf-8", errors="replace")
        for path in (folder / "Eigen/Version", folder / "Eigen/src/Core/util/Macros.h")
        if path.exists()
    )
    words = text.split()
    names = [f"EIGEN_{part}_VERSION" for part in ("WORLD", "MAJOR", "MINOR")]
    return ".".join(words[words.index(n) + 1] if n in words else "?" for n in names)


def _model_text(lib: Library) -> str:
    """The model as pinocchio_bench.cpp reads it, joints in our order."""
    model, ids = _pinocchio_model(lib)
    place = {index: k + 1 for k, index in enumerate(ids)} | {0: 0}
    lines = [_numbers(model.gravity.linear)]
    for index, facts in zip(ids, lib.manifest.joints, strict=True):
        joint, placement = model.joints[index], model.jointPlacements[index]
        axis = _axis(model, index)
        inertia = model.inertias[index].toDynamicParameters()
        numbers = (axis, placement.rotation.ravel(), placement.translation, inertia)
        if joint.nq != 1 or model.parents[index] not in place:
            raise BenchError(f"joint '{facts.name}' is none that the C++ program knows")
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


def _pinocchio_model(lib: Library) -> tuple[Any, list[int]]:
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


def _loop(batch: Batch, one: Callable[..., object], *arrays: Array) -> Callable[[int], float]:
    """Times a Python call per sample, the loop included."""
    rows = list(zip(*(list(x) for x in arrays), strict=True))

    def run(calls: int) -> float:
        start = time.perf_counter_ns()
        for _ in range(calls):
            for row in rows:
                one(*row)
        return (time.perf_counter_ns() - start) / (calls * batch.size)

    return run


def pinocchio_python(lib: Library, batch: Batch) -> Peer:
    """The same algorithms through Pinocchio's Python interface, one call per sample.

    Raises:
        BenchError: not installed.
    """
    model, ids = _pinocchio_model(lib)
    import pinocchio as pin

    data, n = model.createData(), lib.n_joints
    columns = np.array([model.joints[i].idx_v for i in ids])
    order = np.empty(n, dtype=int)
    order[columns] = np.arange(n)
    q, dq, ddq, tau = (x[:, order] for x in (batch.q, batch.dq, batch.ddq, batch.tau))
    motion = (q, dq, ddq)

    def contender(algorithm: str, *arrays: Array, last: Callable[[], Array] | None) -> Contender:
        function = getattr(pin, algorithm)
        return Contender(
            f"pin.{algorithm}",
            _loop(batch, lambda *row: function(model, data, *row), *arrays),
            last,
        )

    rnea = contender("rnea", *motion, last=lambda: data.tau[columns])
    regressor = contender(REGRESSOR, *motion, last=None)
    return Peer(
        f"pin {version('pin')}",
        {
            "inverse_dynamics": rnea,
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
    """`mj_inverse` without contacts and constraints, one call per sample from Python.

    Raises:
        BenchError: not installed, or MuJoCo refuses the URDF.
    """
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
        "mj_inverse", _loop(batch, one, *arrays), lambda: data.qfrc_inverse[columns]
    )
    return Peer(f"mujoco {version('mujoco')}", {"inverse_dynamics": contender, "torque": contender})


def casadi_vm(functions: dict[str, tuple[Any, tuple[str, ...]]], batch: Batch) -> Peer:
    """The very expressions that became our C, in CasADi's virtual machine; one sample, repeated.

    Args:
        functions: kernel → its CasADi function and the names of its inputs.
        batch: its last sample is evaluated.
    """

    def contender(function: Any, names: tuple[str, ...]) -> Contender:
        buffer, trigger = function.buffer()
        arrays = [batch.named(name) for name in names]
        inputs = [np.array(x[-1] if x.ndim == 2 else x) for x in arrays]
        outputs = [np.zeros(function.numel_out(k)) for k in range(function.n_out())]
        for k, x in enumerate(inputs):
            buffer.set_arg(k, x.data)
        for k, x in enumerate(outputs):
            buffer.set_res(k, x.data)

        kept = (buffer, inputs)  # the trigger knows only addresses

        def run(calls: int, _kept: object = kept) -> float:
            start = time.perf_counter_ns()
            for _ in range(calls * batch.size):
                trigger()
            return (time.perf_counter_ns() - start) / (calls * batch.size)

        def last() -> Array:
            return outputs[-1]

        return Contender("Function", run, last)

    found = {name: contender(f, names) for name, (f, names) in functions.items()}
    return Peer(f"casadi {version('casadi')}", found)


def numpy_stored(lib: Library, batch: Batch) -> Peer:
    """What is left for NumPy when Y of all samples is already stored: products with it."""
    n = lib.n_joints
    y = lib.regressor(batch.q, batch.dq, batch.ddq)
    flat = y.reshape(-1, 10 * n)
    by_link = np.ascontiguousarray(flat.reshape(-1, n, 10).transpose(1, 0, 2))
    blocks = lib.pi_jacobian(batch.lam)
    kept: dict[str, Array] = {}

    def torque() -> None:
        kept["torque"] = flat @ batch.pi

    def jacobian() -> None:
        kept["jacobian"] = by_link @ blocks

    def loss() -> None:
        r = flat @ batch.pi - batch.tau.ravel()
        kept["gradient"] = flat.T @ (np.tile(batch.weight, batch.size) * r)

    def contender(
        algorithm: str, whole: Callable[[], None], last: Callable[[], Array] | None
    ) -> Contender:
        def run(calls: int) -> float:
            start = time.perf_counter_ns()
            for _ in range(calls):
                whole()
            return (time.perf_counter_ns() - start) / (calls * batch.size)

        return Contender(algorithm, run, last)

    product = contender("stored Y @ π", torque, lambda: kept["torque"][-n:])
    return Peer(
        f"numpy {np.__version__}",
        {
            "inverse_dynamics": product,
            "torque": product,
            "torque_jacobian": contender(
                "stored Y @ ∂π/∂λ",
                jacobian,
                lambda: kept["jacobian"][:, -n:].transpose(1, 0, 2),
            ),
            "loss_gradient": contender("stored Yᵀ W (Y @ π − τ)", loss, None),
        },
    )
