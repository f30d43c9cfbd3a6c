"""Our functions: the entry points of the compiled library, timed from C; states of all peers.

A Python call costs about as much as the whole batch of a fast kernel, so a few generated lines of
C call the function many times between two readings of the clock. Nothing is subtracted.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.compiled import compiled
from runtime.library import Array, Library
from runtime.library.manifest import KernelFacts


@dataclass(frozen=True, slots=True)
class Batch:
    """N states of one robot."""

    q: Array  # q, dq, ddq, tau: (N, n) [rad or m, ..., N·m or N]; tau is Y π with noise
    dq: Array
    ddq: Array
    tau: Array
    pi: Array  # pi, lam, beta: (10 n,), (10 n,), (n_b,) of the URDF
    lam: Array
    beta: Array
    weight: Array  # weight, rotor: (n,), ones and zeros
    rotor: Array

    @property
    def size(self) -> int:
        """N."""
        return len(self.q)

    def named(self, name: str) -> Array:
        """Array for the kernel input of this name."""
        return np.ascontiguousarray(getattr(self, name))

    def part(self, rows: slice) -> "Batch":
        """Only these samples."""
        parts = {key: self.named(key)[rows] for key in ("q", "dq", "ddq", "tau")}
        return replace(self, **parts)


def make_batch(lib: Library, samples: int, seed: int = 0) -> Batch:
    """Random positions, velocities and accelerations."""
    rng = np.random.default_rng(seed)
    n = lib.n_joints
    q = rng.uniform(-np.pi, np.pi, (samples, n))
    dq, ddq = rng.normal(0, 2, (samples, n)), rng.normal(0, 5, (samples, n))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + rng.normal(0, 1, (samples, n))
    beta = lib.base_matrix @ lib.pi0
    return Batch(q, dq, ddq, tau, lib.pi0, lib.lam0, beta, np.ones(n), np.zeros(n))


@dataclass(frozen=True, slots=True)
class Symbolic:
    """Expressions of one kernel."""

    function: Any  # of CasADi
    inputs: tuple[str, ...]  # their names
    operations: int  # per sample, without what depends on shared inputs alone
    sines: int  # how many of them are sines and cosines


def symbolic(lib: Library, names: tuple[str, ...]) -> dict[str, Symbolic]:
    """Generate a library's kernels once more, from the URDF and options that it was built from."""
    from symgen.catalogue import make_catalogue
    from symgen.chain import read_chain
    from symgen.make.request import request_from_folder

    request = request_from_folder(lib.folder)
    catalogue = make_catalogue(read_chain(request.urdf, request.options))
    return {k.name: facts_of(k) for k in catalogue.kernels if k.name in names}


def facts_of(kernel: Any) -> Symbolic:
    """Counts of a kernel's instruction list; a sine or cosine is one operation."""
    import casadi as ca

    operations = sines = 0
    per_sample: dict[int, bool] = {}
    for op, ins, outs, _ in kernel.instructions:
        if op == ca.OP_INPUT:
            per_sample[outs[0]] = not kernel.inputs[ins[0]].shared
        elif op == ca.OP_CONST:
            per_sample[outs[0]] = False
        elif op != ca.OP_OUTPUT:
            per_sample[outs[0]] = any(per_sample[i] for i in ins)
            operations += per_sample[outs[0]]
            sines += per_sample[outs[0]] and op in {ca.OP_SIN, ca.OP_COS}
    return Symbolic(kernel.function, tuple(a.name for a in kernel.inputs), operations, sines)


LANES = 8  # samples of a tile, at every level
LAYOUTS = ("tiles", "stored", "batch")
"""Tile-major arrays in place, the same with stored sines and cosines, sample-major arrays."""

_HEAD = """\
#include <time.h>
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1e9 + t.tv_nsec;
}
"""


@dataclass(frozen=True, slots=True)
class Contender:
    """One function on one layout."""

    samples: int  # per call
    run: Callable[[int], float]  # (calls) → ns per sample
    answer: Callable[[], Array]  # the last output after a run, (N, size)


class Ours:
    """Times kernels of one library at every level."""

    def __init__(self, lib: Library, names: tuple[str, ...]) -> None:
        self._lib = lib
        self._kernels = {name: lib.manifest.kernels[name] for name in names}
        timers = (_timers(kernel) for kernel in self._kernels.values())
        self._timers = compiled("timers", _HEAD + "".join(timers))
        self._dll = ctypes.CDLL(str((Path(lib.folder) / f"lib{lib.name}.so").resolve()))

    def numbers(self, name: str) -> int:
        """Numbers that a kernel writes per sample."""
        return sum(a.size for a in self._kernels[name].outputs if not a.summed)

    def contender(self, name: str, level: str, layout: str, batch: Batch) -> Contender | None:
        """Function that times itself over the batch; None where the library has no such kernel."""
        kernel = self._kernels[name]
        suffix = "batch" if layout == "batch" else "tiles"
        symbol = f"{self._lib.name}_{level}_{name}_{suffix}"
        if not hasattr(self._dll, symbol):
            return None
        entry = ctypes.cast(self._dll[symbol], ctypes.c_void_p)
        timer = self._timers[f"time_{name}_{suffix}"]
        timer.restype = ctypes.c_double
        prepared = _sample_major if layout == "batch" else partial(_tile_major, layout == "stored")
        count, arrays, words, answer = prepared(kernel, batch)

        def run(calls: int, _kept: tuple[Array, ...] = arrays) -> float:  # words are addresses
            took = timer(entry, ctypes.c_long(calls), ctypes.c_long(count), *words)
            return float(took) / batch.size

        return Contender(batch.size, run, answer)


Prepared = tuple[int, tuple[Array, ...], list[object], Callable[[], Array]]
"""Samples or tiles, arrays, arguments that point to them, and what reads the last output."""


def _sample_major(kernel: KernelFacts, batch: Batch) -> Prepared:
    inputs = [batch.named(a.name) for a in kernel.inputs]
    outputs = [_aligned(1 if a.summed else batch.size, a.size) for a in kernel.outputs]
    words: list[object] = []
    for a, x in zip(kernel.inputs, inputs, strict=True):
        words += [ctypes.c_void_p(x.ctypes.data), ctypes.c_long(a.size if x.ndim == 2 else 0)]
    words += [ctypes.c_void_p(out.ctypes.data) for out in outputs]
    return batch.size, (*inputs, *outputs), words, lambda: outputs[-1]


def _tile_major(stored: bool, kernel: KernelFacts, batch: Batch) -> Prepared:
    tiles = batch.size // LANES
    given = [batch.named(a.name) for a in kernel.inputs]
    inputs = [_as_tiles(x) if x.ndim == 2 else x for x in given]
    outputs = [_aligned(tiles, a.size * LANES) for a in kernel.outputs]
    for out in outputs:
        out[:] = 0.0  # rows that are zero by structure are never written
    sc = _as_tiles(_sines(batch))
    arrays = (sc, *inputs, *outputs)
    words: list[object] = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
    if not stored:
        words[0] = ctypes.c_void_p(None)

    def answer() -> Array:
        return outputs[-1].reshape(tiles, -1, LANES).transpose(0, 2, 1).reshape(batch.size, -1)

    return tiles, arrays, words, answer


def _sines(batch: Batch) -> Array:
    return np.stack([np.sin(batch.q), np.cos(batch.q)], axis=2).reshape(batch.size, -1)


def _as_tiles(x: Array) -> Array:
    """(N, size) → (N / 8, size · 8), row k of a tile holding entry k of its eight samples."""
    tiles = _aligned(len(x) // LANES, x.shape[1] * LANES)
    tiles[:] = x.reshape(len(tiles), LANES, -1).transpose(0, 2, 1).reshape(len(tiles), -1)
    return tiles


def _aligned(rows: int, columns: int) -> Array:
    """Uninitialised, beginning at a multiple of 64 bytes."""
    raw = np.empty(rows * columns + LANES)
    skip = -(raw.ctypes.data // 8) % LANES
    return raw[skip : skip + rows * columns].reshape(rows, columns)


def _timers(kernel: KernelFacts) -> str:
    """C that calls a function `calls` times and returns nanoseconds per call, for both layouts."""
    inputs, outputs = [a.name for a in kernel.inputs], [f"{a.name}_out" for a in kernel.outputs]
    batch = [part for name in inputs for part in (f"const double *{name}", f"long {name}_step")]
    batch += [f"double *{name}" for name in outputs]
    tiles = ["const double *sc", *(f"const double *{name}" for name in inputs)]
    tiles += [f"double *{name}" for name in outputs]
    return "".join(
        f"""
__attribute__((visibility("default")))
double time_{kernel.name}_{layout}(void (*call)(long, {", ".join(arguments)}), long calls, long n,
    {", ".join(arguments)})
{{
    const double from = now();
    for (long k = 0; k < calls; ++k) call(n, {", ".join(_name(item) for item in arguments)});
    return (now() - from) / (double)calls;
}}
"""
        for layout, arguments in (("batch", batch), ("tiles", tiles))
    )


def _name(declaration: str) -> str:
    return declaration.rpartition(" ")[2].lstrip("*")
