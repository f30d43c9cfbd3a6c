"""Batches through torch and JAX beside the C function, adam and loops over Pinocchio.

All take the same states in turn, round after round. A contender has the median of its times over
those of the C function in the same rounds, so that load of other work falls on both. adam, which
pins an old JAX, answers from a Python of its own.
"""

import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import runtime
from bench.compiled import interleave, ratio
from bench.front import BenchError, Sheet, ratio_text
from bench.peers import pinocchio_in_order
from runtime.library import Library

KERNELS = {
    "inverse_dynamics": ("inverse_dynamics", ("q", "dq", "ddq")),
    "mass_matrix": ("mass_matrix", ("q",)),
    "bias": ("bias_forces", ("q", "dq")),
    "forward_dynamics": ("forward_dynamics", ("q", "dq", "tau")),
}
"""Kernel and states of a function."""
PINOCCHIO = {
    "inverse_dynamics": "rnea",
    "mass_matrix": "crba",
    "bias": "nonLinearEffects",
    "forward_dynamics": "aba",
}
CHILD = Path(__file__).parents[1] / "simulators" / "adam_rates.py"
Call = Callable[[], float]
"""Seconds of one call over all states."""


def measure(lib: Library, count: int, rounds: int, adam: str | None) -> list[dict[str, Any]]:
    """Seconds of the C function, and ratios to them, per function and contender."""
    rng, n = np.random.default_rng(0), lib.n_joints
    states = {"q": rng.uniform(-1, 1, (count, n)), "dq": rng.normal(0, 1, (count, n))}
    states["ddq"] = rng.normal(0, 2, (count, n))
    states["tau"] = lib.inverse_dynamics(*states.values(), lib.pi0)
    found = []
    with ExitStack() as stack:
        peers = {}
        for backend in ("torch", "jax") if adam else ():
            peers[f"adam, {backend}"] = stack.enter_context(_adam(adam, backend, lib, states))
        for name, (kernel, inputs) in KERNELS.items():
            given = [states[key] for key in inputs]
            calls = _ours(lib, name, kernel, given)
            calls |= {peer: _asked(process, name) for peer, process in peers.items()}
            calls["Pinocchio loop"] = _loop(lib, name, given)
            times = interleave(calls, rounds, passes=1)
            ratios = {c: ratio(t, times["C"]) for c, t in times.items() if c != "C"}
            least = float(times["C"].min())
            found.append({"robot": lib.name, "function": name, "seconds": least, "ratios": ratios})
    return found


OURS = ("C", "torch", "JAX")


def _ours(lib: Library, name: str, kernel: str, given: list[Any]) -> dict[str, Call]:
    """The C function on memory that is there, and the same through both programs."""
    import jax
    import torch

    jax.config.update("jax_enable_x64", True)
    torch.set_num_threads(1)
    n, facts = len(given[0]), lib.binding.kernel(kernel)
    arrays = [*given, lib.pi0, *[np.zeros(a.size) for a in facts.inputs[len(given) + 1 :]]]
    steps = [x.shape[-1] if x.ndim == 2 else 0 for x in arrays]
    result = np.empty((n, facts.outputs[0].size))
    by_torch, tensors = getattr(runtime.torch(lib), name), [torch.tensor(x) for x in given]
    by_jax = jax.jit(getattr(runtime.jax(lib), name))
    buffers = [jax.numpy.asarray(x) for x in given]

    def by_c(places: list[int], target: list[int], held: object) -> None:
        lib.binding.run(kernel, n, places, steps, target)

    held = ([x.ctypes.data for x in arrays], [result.ctypes.data], (arrays, result))
    return {
        "C": _timed(lambda: by_c(*held)),
        "torch": _timed(lambda: by_torch(*tensors)),
        "JAX": _timed(lambda: by_jax(*buffers).block_until_ready()),
    }


def _timed(call: Callable[[], object]) -> Call:
    def seconds() -> float:
        start = time.perf_counter()
        call()
        return time.perf_counter() - start

    return seconds


def _loop(lib: Library, name: str, given: list[Any]) -> Call:
    """One call of Pinocchio per state, from Python."""
    pinocchio, model, _, _, order = pinocchio_in_order(lib)
    function, data = getattr(pinocchio, PINOCCHIO[name]), model.createData()
    rows = list(zip(*(list(x[:, order]) for x in given), strict=True))

    def every() -> None:
        for row in rows:
            function(model, data, *row)

    return _timed(every)


@contextmanager
def _adam(python: str, backend: str, lib: Library, states: dict[str, Any]) -> Iterator[Any]:
    """A process that answers with the seconds of a function."""
    q, dq = states["q"], states["dq"]
    right = {
        "M": lib.mass_matrix(q, lib.pi0),
        "h": lib.bias_forces(q, dq, lib.pi0),
        "joints": np.array(lib.joint_names),
        "gravity": lib.gravity,
    }
    with tempfile.TemporaryDirectory() as folder:
        urdf, file = Path(folder, "robot.urdf"), Path(folder, "states.npz")
        urdf.write_text(lib.urdf(), encoding="utf-8")
        np.savez(file, **states, **right)
        command = [python, str(CHILD), backend, str(urdf), str(file)]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
            yield process
            process.stdin.close()


def _asked(process: Any, name: str) -> Call:
    def seconds() -> float:
        process.stdin.write(f"{name}\n")
        process.stdin.flush()
        line = process.stdout.readline()
        if not line:
            raise BenchError(f"adam gave no answer for {name}; its message stands above")
        return float(line)

    return seconds


def sheet(rows: list[dict[str, Any]]) -> Sheet:
    """Least microseconds of the C function, and how many times as long the others take."""
    peers = list(rows[0]["ratios"])
    lines = []
    for row in rows:
        ratios = row["ratios"].items()
        times = [f"{x:.2f}×" if name in OURS else ratio_text(x) for name, x in ratios]
        lines.append((row["robot"], row["function"], f"{1e6 * row['seconds']:.0f}", *times))
    return Sheet("bench_tapes", ("robot", "function", "C, µs", *peers), lines, rows)
