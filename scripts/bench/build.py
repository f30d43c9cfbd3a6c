"""The run behind `scripts/bench_build`: a real build in an empty folder, its compiler timed.

`python -m symgen build` runs as a user would start it, with $CC pointing to a wrapper that runs
the same compiler and notes when each call began and ended; nothing else is different.
"""

import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.front import ROOT, BenchError, Sheet
from runtime.common.compiler import compiler_version, find_compiler

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
class Report:
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


def measure(robot: str, kept: Path | None = None, levels: Sequence[str] = ()) -> Report:
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
    units = sorted(
        (
            Unit(Path(command[command.index("-o") + 1]).stem, begin - start, end - begin)
            for begin, end, command in calls
            if "-c" in command
        ),
        key=lambda unit: unit.start,
    )
    links = [end - begin for begin, end, command in calls if "-shared" in command]
    first = units[0].start
    return Report(
        robot=robot,
        compiler=compiler_version(compiler),
        cores=os.cpu_count() or 1,
        generate=first,
        compile=max(unit.start + unit.seconds for unit in units) - first,
        link=sum(links),
        total=total,
        again=again,
        bytes=size,
        units=tuple(units),
    )


def _build(robot: str, out: Path, compiler: tuple[str, ...], levels: Sequence[str]) -> float:
    """Seconds of one `symgen build`."""
    path = os.pathsep.join((str(ROOT), *filter(None, (os.environ.get("PYTHONPATH"),))))
    environment = os.environ | {"CC": shlex.join(compiler), "PYTHONPATH": path}
    command = [sys.executable, "-m", "symgen", "build", "--robot", robot, "--out", str(out)]
    command += [word for level in levels for word in ("--level", level)]
    start = time.perf_counter()
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise BenchError(f"the build of '{robot}' failed: {run.stderr.strip()[-2000:]}")
    return time.perf_counter() - start


def sheet(report: Report) -> Sheet:
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
