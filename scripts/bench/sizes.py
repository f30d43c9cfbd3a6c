"""Cost of builds: of robots of many joints, and of every compilation of one robot.

A timed build runs `python -m symgen build` as a user would, with $CC pointing to a wrapper that
runs the same compiler and notes when each call began and ended; nothing else is different.
"""

import json
import os
import shlex
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from bench import arms
from bench.front import BenchError, Sheet, cpu_seconds, python, sheet_of
from runtime.common.compiler import compiler_version, find_compiler
from runtime.library import load

COUNTS = {7: (), 15: (1, 2, 7), 29: (1, 4, 7), 60: (4, 8, 7)}
"""Joints → trunk, branches and joints per branch of `arms.branching`; empty: a serial arm."""
SAMPLES = 20_000  # states of a timed batch
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

_COSTS = {"build, CPU s": ".1f", "MB": ".0f", "τ alone, CPU s": ".2f", "τ, ns per sample": ".0f"}
COLUMNS = {"joints": "", **_COSTS, "kernels omitted": ""}
"""CPU time of the whole build for all levels, its largest process, the kernel of τ alone for one
level, and τ of one sample in a batch on one core."""


def sizes(counts: tuple[int, ...], serial: tuple[int, ...], folder: Path) -> Sheet:
    """Build robots of these sizes without a compiler cache, serial chains too; and exponents."""
    rows = [_size(count, COUNTS[count], folder) for count in counts]
    rows += [_size(count, (), folder) for count in serial]
    whole = sheet_of("bench_sizes", COLUMNS, rows, title="build cost")
    if len(rows) < 2:
        return whole
    joints, costs = np.log([*counts, *serial]), np.log([row[1:5] for row in rows])
    slopes = (f"{slope:.2f}" for slope in np.polyfit(joints, costs, 1)[0])
    return replace(whole, lines=[*whole.lines, ["exponent", *slopes, ""]])


def _size(joints: int, shape: tuple[int, ...], folder: Path) -> tuple:
    urdf = arms.branching(*shape) if shape else arms.serial(joints)
    name = f"size{joints}" if shape else f"serial{joints}"
    path = folder / f"{name}.urdf"
    path.write_text(urdf, encoding="utf-8")
    run = python("-c", _RUN, name, path, folder, CCACHE_DISABLE="1")
    run.check_returncode()
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
    label = f"{joints}{'' if shape else ' serial'}"
    return label, cpu, memory, _torque_cpu(urdf), torque_ns, omitted


def _torque_cpu(urdf: str) -> float:
    """CPU time of the kernel of τ alone: expressions, C text, compilation for one level."""
    from symgen import __version__
    from symgen.catalogue.motion import state_unit
    from symgen.chain import read_chain
    from symgen.emit.files import emit
    from symgen.kernel import Argument, make_kernel
    from symgen.make.compiler import PORTABLE, compile_library
    from symgen.mechanics.base_parameters import regrouped
    from symgen.mechanics.dynamics import inverse_dynamics

    os.environ["CCACHE_DISABLE"] = "1"
    start = cpu_seconds()
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
    return cpu_seconds() - start


_WRAPPER = """\
import json, os, subprocess, sys, time
log, *command = sys.argv[1:]
start = time.time()
status = subprocess.run(command).returncode
with open(log, "a") as out:
    out.write(json.dumps([start, time.time(), command]) + "\\n")
sys.exit(status)
"""


@dataclass(frozen=True, slots=True)
class Unit:
    """One call of the compiler, seconds from the start of the build."""

    name: str
    start: float
    seconds: float


@dataclass(frozen=True, slots=True)
class Build:
    """Seconds of one build from nothing, and of the call after it."""

    robot: str
    compiler: str
    cores: int
    generate: float  # from the start of Python to the first compilation: imports, URDF to C text
    compile: float  # from the first compilation to the end of the last, in parallel
    link: float  # of the shared library
    total: float  # as the user waits, hashes and renaming included
    again: float  # the same command once more, with nothing to do
    bytes: int
    units: tuple[Unit, ...]  # every compilation; they overlap


def one_build(robot: str, kept: Path | None = None, levels: Sequence[str] = ()) -> Build:
    """Build a bundled robot twice in an empty folder."""
    if kept is not None and kept.exists() and any(kept.iterdir()):
        raise BenchError(f"'{kept}' is not empty, and a build from nothing needs an empty folder")
    compiler = find_compiler()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wrapper, log = folder / "timed.py", folder / "calls.jsonl"
        wrapper.write_text(_WRAPPER, encoding="utf-8")
        timed = (sys.executable, "-I", "-S", str(wrapper), str(log), *compiler)
        out = kept or folder / "generated"
        start = time.time()
        total = _build(robot, out, timed, levels)
        again = _build(robot, out, timed, levels)
        lines = log.read_text(encoding="utf-8").splitlines()
        size = (out / robot / f"lib{robot}.so").stat().st_size
    calls = [json.loads(line) for line in lines]
    units = tuple(
        Unit(Path(command[command.index("-o") + 1]).stem, begin - start, end - begin)
        for begin, end, command in sorted(calls)
        if "-c" in command
    )
    links = [end - begin for begin, end, command in calls if "-shared" in command]
    first = units[0].start
    return Build(
        robot=robot,
        compiler=compiler_version(compiler),
        cores=os.cpu_count() or 1,
        generate=first,
        compile=max(unit.start + unit.seconds for unit in units) - first,
        link=sum(links),
        total=total,
        again=again,
        bytes=size,
        units=units,
    )


def _build(robot: str, out: Path, compiler: tuple[str, ...], levels: Sequence[str]) -> float:
    """Seconds of one `symgen build`."""
    words = [word for level in levels for word in ("--settings", f"level={level}")]
    start = time.perf_counter()
    command = ("-m", "symgen", "build", "--robot", robot, "--out", out, *words)
    run = python(*command, CC=shlex.join(compiler))
    if run.returncode != 0:
        raise BenchError(f"the build of '{robot}' failed: {run.stderr.strip()[-2000:]}")
    return time.perf_counter() - start


def build_sheet(report: Build) -> Sheet:
    """Stages and units, in seconds."""
    lines = [("start Python, read, generate", "0.00", f"{report.generate:.2f}")]
    for unit in report.units:
        lines.append((f"  compile {unit.name}", f"{unit.start:.2f}", f"{unit.seconds:.2f}"))
    lines.append(("compile, all", f"{report.generate:.2f}", f"{report.compile:.2f}"))
    for name in ("link", "total", "again"):
        lines.append((name, "", f"{getattr(report, name):.2f}"))
    title = f"{report.robot}: from nothing to the compiled library"
    caption = (
        f"{report.compiler}, {report.cores} cores; compilations overlap. The library has "
        f"{report.bytes / 1e6:.2f} MB. again: a second call with nothing to do."
    )
    return Sheet("", ("stage", "begins", "seconds"), lines, report, title, caption)
