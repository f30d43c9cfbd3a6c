"""Pinocchio's header-only algorithms in C++, compiled with clang for this processor."""

import ctypes
import itertools
import shlex
import shutil
import tempfile
from collections.abc import Callable
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import platformdirs

from bench.batch import Batch
from bench.compiled import processor
from bench.front import BenchError
from bench.peers import REGRESSOR, Contender, Peer, pinocchio_model
from runtime.common.compiler import compiler_version, run
from runtime.library import Array, Library, to_pinocchio_order

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
