"""Torques per second on all cores, beside frax on the same cores and published figures of GPUs.

The kernel τ of base parameters runs over arrays of tiles in one thread per core, its loop in C.
frax is Python on JAX: `vmap` of its `rnea` of a Panda, compiled and distributed to threads by XLA,
in a separate interpreter per precision. All are measured by the wall clock, the best of many bursts
of some milliseconds, because a shared machine only adds to times.
"""

import importlib.util
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np

from bench import ours
from bench.batch import make_batch
from bench.compiled import find
from bench.front import Sheet, python, sheet_of
from bench.ours import Contender, Ours
from runtime.common.threads import cores
from runtime.library import Library

KERNEL, SAMPLES = "base_inverse_dynamics", 256
BURST = 4e-3  # duration of one burst [s]
PUBLISHED = "arXiv:2604.04310: upwards of 100 million dynamics evaluations per second, Panda"
FRAX = "frax, JAX on these cores"
_CHILD = """
import sys, time
import jax, numpy as np
from frax.robots.franka_panda import load_panda
double, count, seconds = sys.argv[1] == "double", int(sys.argv[2]), float(sys.argv[3])
jax.config.update("jax_enable_x64", double)
panda, gravity = load_panda(), jax.numpy.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
torques = jax.jit(jax.vmap(lambda q, v, a: panda.rnea(q, v, a, gravity, None)))
draw = np.random.default_rng(0).uniform(-1.0, 1.0, (3, count, 7))
motion = [jax.numpy.asarray(each, "float64" if double else "float32") for each in draw]
torques(*motion).block_until_ready()
best, start = float("inf"), time.perf_counter()
while time.perf_counter() - start < seconds:
    before = time.perf_counter()
    torques(*motion).block_until_ready()
    best = min(best, time.perf_counter() - before)
print(count / best)
"""
BATCHES = (256, 1024, 16384)  # sizes of the batches of frax, of which the fastest counts


@dataclass(frozen=True, slots=True)
class Rate:
    """Throughput of one program."""

    work: str  # what was run
    precision: str  # "double" or "single"
    rate: float | None  # torques of all joints per second; None where it was not measured
    remark: str = ""  # source or reason


def measure(lib: Library, seconds: float) -> list[Rate]:
    """Rates of the library and of its peers."""
    ours = Ours(lib, (KERNEL,), find(("cc", "gcc", "clang")))
    count, rows = cores(), []
    for layout, label in (("tiles", "sines computed"), ("stored", "sines stored")):
        each = [
            ours.contender(KERNEL, lib.level, layout, make_batch(lib, SAMPLES, seed=k))
            for k in range(count)
        ]
        present = [one for one in each if one is not None]
        what = f"τ of {lib.name}, {lib.level}, {label}"
        rows.append(Rate(what, "double", _rate(present, seconds), f"{count} threads"))
    rows.append(_single(lib, seconds, count))
    for precision in ("double", "single"):
        rows.append(_frax(precision, seconds))
    return [*rows, Rate("frax on a GPU, as published", "single", 1e8, PUBLISHED)]


def _single(lib: Library, seconds: float, count: int) -> Rate:
    """Rate of the same kernel compiled with `float`; the remark states its rounding."""
    batches = [make_batch(lib, SAMPLES, seed=k) for k in range(count)]
    each = [ours.single_contender(lib, find(("gcc", "cc")), batch) for batch in batches]
    rate, first = _rate(each, seconds), batches[0]
    tau = lib.base_inverse_dynamics(first.q, first.dq, first.ddq, first.beta)
    error = float(np.abs(each[0].answer() - tau).max() / np.abs(tau).max())
    remark = f"{count} threads; the generated C compiled with float, within {error:.0e} of double"
    return Rate(f"τ of {lib.name}, {lib.level}, sines stored", "single", rate, remark)


def _rate(contenders: list[Contender], seconds: float) -> float:
    """Torques per second of one thread per contender, the best burst."""
    calls = max(1, round(BURST * 1e9 / (contenders[0].run(100) * SAMPLES)))
    best, until = float("inf"), time.perf_counter() + seconds
    with ThreadPoolExecutor(len(contenders)) as pool:
        while time.perf_counter() < until:
            start = time.perf_counter()
            list(pool.map(lambda one: one.run(calls), contenders))
            best = min(best, time.perf_counter() - start)
    return calls * SAMPLES * len(contenders) / best


def _frax(precision: str, seconds: float) -> Rate:
    """Rate of frax at its better batch; the reason where it cannot run."""
    if importlib.util.find_spec("frax") is None:
        return Rate(FRAX, precision, None, "not installed: pip install frax")
    best, size = 0.0, 0
    for batch in BATCHES:
        run = python("-c", _CHILD, precision, batch, seconds, JAX_PLATFORMS="cpu")
        if run.returncode:
            last = (run.stderr.strip().splitlines() or ["no message"])[-1]
            return Rate(FRAX, precision, None, f"failed: {last[:80]}")
        if (rate := float(run.stdout.split()[-1])) > best:
            best, size = rate, batch
    return Rate(FRAX, precision, best, f"Panda, batches of {size}")


def sheet(rows: list[Rate]) -> Sheet:
    """One line per program."""
    facts = [asdict(r) | {"M": "–" if r.rate is None else f"{r.rate / 1e6:.3g}"} for r in rows]
    columns = {"program": "{work}", "precision": "{precision}"}
    columns |= {"million torques per second": "{M}", "remark": "{remark}"}
    title = "Torques per second on all cores"
    return sheet_of("bench_throughput", columns, facts, facts=rows, title=title)
