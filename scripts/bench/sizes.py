"""Build cost of robots of many joints: CPU time, memory, and the time of one torque."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from bench import arms
from bench.front import Sheet
from runtime.library import load

COUNTS = {7: (), 15: (1, 2, 7), 29: (1, 4, 7), 60: (4, 8, 7)}
"""Joints → trunk, branches and joints per branch of `arms.branching`; empty: a serial arm."""
SAMPLES = 20_000
"""States of a timed batch."""
_RUN = """
import json, resource, sys
from pathlib import Path
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
build(BuildRequest(sys.argv[1], Path(sys.argv[2]).read_text()), Path(sys.argv[3]))
parts = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
cpu = sum(part.ru_utime + part.ru_stime for part in parts)
print(json.dumps([cpu, max(part.ru_maxrss for part in parts) / 1024]))
"""


@dataclass(frozen=True, slots=True)
class Size:
    """Cost of one robot."""

    joints: int
    cpu: float  # of the whole build, all levels [s]
    memory: float  # largest of any process of the build [MB]
    torque_cpu: float  # of generating and compiling inverse dynamics alone, for one level [s]
    torque_ns: float  # inverse dynamics of one sample in a batch, on one core [ns]
    omitted: int  # number of kernels that the robot does not get
    is_serial: bool = False  # one chain rather than a trunk with branches


def sizes(counts: tuple[int, ...], serial: tuple[int, ...], folder: Path) -> list[Size]:
    """Build robots of these sizes, without a compiler cache."""
    branching = [_size(count, COUNTS[count], folder) for count in counts]
    return branching + [_size(count, (), folder) for count in serial]


def _size(joints: int, shape: tuple[int, ...], folder: Path) -> Size:
    urdf = arms.branching(*shape) if shape else arms.serial(joints)
    name = f"size{joints}" if shape else f"serial{joints}"
    path = folder / f"{name}.urdf"
    path.write_text(urdf, encoding="utf-8")
    environment = os.environ | {"CCACHE_DISABLE": "1"}
    command = [sys.executable, "-c", _RUN, name, str(path), str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    cpu, memory = json.loads(run.stdout)
    lib = load(folder / name, threads=1)
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, SAMPLES, joints))
    times = []
    for _ in range(5):
        start = time.perf_counter()
        lib.inverse_dynamics(q, dq, ddq, lib.pi0)
        times.append(time.perf_counter() - start)
    omitted = len(lib.manifest.omitted)
    torque_ns = 1e9 * min(times) / SAMPLES
    return Size(joints, cpu, memory, _torque_cpu(urdf), torque_ns, omitted, not shape)


def _torque_cpu(urdf: str) -> float:
    """CPU time of the kernel of τ alone: expressions, C text, compilation for one level."""
    from symgen import __version__
    from symgen.catalogue.motion import state_unit
    from symgen.chain import read_chain
    from symgen.emit import emit
    from symgen.kernel import Argument, make_kernel
    from symgen.make.compiler import PORTABLE, compile_library
    from symgen.mechanics.base_parameters import regrouped
    from symgen.mechanics.dynamics import inverse_dynamics

    os.environ["CCACHE_DISABLE"] = "1"
    start = _cpu()
    chain = read_chain(urdf)
    n = chain.freedom
    inputs = [Argument(key, (n,), state_unit(chain, k)) for k, key in enumerate(("q", "dq", "ddq"))]
    inputs.append(Argument("pi", (10 * len(chain.joints),), "SI", shared=True))
    symbols = [argument.symbol() for argument in inputs]
    tau = inverse_dynamics(chain, *symbols[:3], regrouped(chain, symbols[3]))
    kernel = make_kernel(
        "inverse_dynamics",
        dict(zip(inputs, symbols, strict=True)),
        {Argument("tau", (n,), "N*m"): tau},
        "tau",
    )
    facts = {
        "base_parameters": {"columns": []}, "gravity": [], "base": "base", "tip": "", "joints": [],
        "pi_names": [], "lam_names": [], "pi0": [], "home": [], "tip_speed": None,
        "torque_rate": None, "braking": None, "proxy": [], "pair": [], "moving_proxies": [],
    }  # fmt: skip
    versions = {"symgen": __version__, "casadi": version("casadi")}
    files = emit("size", (kernel,), facts, versions).files
    with tempfile.TemporaryDirectory() as scratch:
        for file, text in files.items():
            (Path(scratch) / file).write_text(text, encoding="utf-8")
        once, per_level = [Path(scratch) / "kernels.c"], [Path(scratch) / "tiles.c"]
        compile_library(once, Path(scratch) / "libsize.so", per_level, wanted=list(PORTABLE))
    return _cpu() - start


def _cpu() -> float:
    parts = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(part.ru_utime + part.ru_stime for part in parts)


def exponent(rows: list[Size], key: str) -> float:
    """Slope of log cost over log joints."""
    joints = np.log([row.joints for row in rows])
    return float(np.polyfit(joints, np.log([getattr(row, key) for row in rows]), 1)[0])


def sheet(rows: list[Size]) -> Sheet:
    """One line per robot, and the exponents of joints."""
    head = ("joints", "build, CPU s", "MB", "τ alone, CPU s", "τ, ns per sample", "kernels omitted")
    lines = [
        (
            f"{r.joints}{' serial' if r.is_serial else ''}",
            *(f"{r.cpu:.1f}", f"{r.memory:.0f}", f"{r.torque_cpu:.2f}", f"{r.torque_ns:.0f}"),
            str(r.omitted),
        )
        for r in rows
    ]
    if len(rows) > 1:
        keys = ("cpu", "memory", "torque_cpu", "torque_ns")
        lines.append(("exponent", *(f"{exponent(rows, key):.2f}" for key in keys), ""))
    return Sheet("bench_sizes", head, lines, {"sizes": rows}, "build cost")
