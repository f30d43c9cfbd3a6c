"""A process of limited time and memory that does one job on a file of others: JSON in, JSON out.

The parent calls `answer_of`, the module that runs there `serve`. A parser that hangs, exhausts the
memory or crashes ends its own process, not that of the user.
"""

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import Any

try:
    import resource
except ImportError:  # Windows has a limit of time only, that of the parent
    resource = None  # type: ignore[assignment]

_PROGRAM = (
    "import json, runpy, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "runpy.run_path(sys.argv[2], run_name='__main__')"
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one job; the largest published robots take two seconds."""

    seconds: int = 20  # processor time [s]
    patience: float = 120.0  # time until the process is ended whatever it does [s]
    memory: int = 2**30  # address space [B]
    file: int = 0  # size of a file that it may write [B]


class ExceededError(Exception):
    """The process has reached a limit or crashed; the text says which."""


def answer_of(module: str, job: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
    """Answer of a process that runs a module."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ImportError(f"module '{module}' is not found")
    try:
        run = subprocess.run(
            [sys.executable, "-I", "-B", "-c", _PROGRAM, json.dumps(sys.path), spec.origin],
            input=json.dumps({"job": dict(job), "limits": asdict(limits)}).encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=limits.patience,
            check=False,
            # Each thread of BLAS reserves address space; MuJoCo need not look for a display.
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "disable"},
        )
    except subprocess.TimeoutExpired:
        raise ExceededError(f"{limits.patience:g} s") from None
    if run.returncode == -getattr(signal, "SIGXCPU", 256):  # Windows has no such limit
        raise ExceededError(f"{limits.seconds} s of processor time")
    try:
        return dict(json.loads(run.stdout))
    except ValueError:
        memory = f"{limits.memory >> 20} MiB of memory (code {run.returncode})"
        raise ExceededError(memory) from None


def serve(work: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Read a job, set the limits, do the work and write its answer."""
    output, sys.stdout = sys.stdout, io.StringIO()
    order = json.load(sys.stdin)
    _limit(order["limits"])
    try:
        json.dump(work(order["job"]), output)
        output.flush()
    except BaseException:  # no memory is left for an answer
        sys.exit(3)


def _limit(limits: Mapping[str, Any]) -> None:
    """Limit processor time, memory and files that are written; no core is left."""
    if resource is None:
        return
    seconds, memory, file = limits["seconds"], limits["memory"], limits["file"]
    hard = {"CPU": seconds + 5, "AS": memory, "FSIZE": file, "CORE": 0}
    for name, most in hard.items():
        try:
            ends = (seconds, most) if name == "CPU" else (most, most)
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), ends)
        except (ValueError, OSError):  # a lower limit is in force, or the system has none
            continue
