"""Our batch functions: the entry points of the compiled library, timed from C.

A Python call costs about as much as the whole batch of a fast kernel, so a few generated lines of
C call the batch function many times between two readings of the clock. The library, the
arguments and the layout are those of `runtime.load`; nothing is subtracted.
"""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.batch import Batch
from bench.compiled import Compiler, compile_shared, open_shared
from runtime.library import Array, Library
from runtime.library.manifest import KernelFacts

_HEAD = """\
#include <time.h>
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1e9 + t.tv_nsec;
}
"""


class Ours:
    """Times kernels of one library at every level."""

    def __init__(
        self, lib: Library, names: tuple[str, ...], batch: Batch, compiler: Compiler
    ) -> None:
        self._lib, self._batch = lib, batch
        self._kernels = {name: lib.manifest.kernels[name] for name in names}
        source = _HEAD + "".join(_timer(kernel) for kernel in self._kernels.values())
        path, _ = compile_shared(compiler, ("-O2",), source, ".c")
        self._timers = open_shared(path)
        self._dll = ctypes.CDLL(str((Path(lib.folder) / f"lib{lib.name}.so").resolve()))

    def measure(self, name: str, level: str) -> tuple[Callable[[int], float], list[Array]]:
        """A function (calls) → ns per sample, and the outputs it writes, (N, size) each."""
        kernel, batch = self._kernels[name], self._batch
        prefix = self._lib.name if level == "portable" else f"{self._lib.name}_{level}"
        entry = ctypes.cast(self._dll[f"{prefix}_{name}_batch"], ctypes.c_void_p)
        inputs = [batch.named(a.name) for a in kernel.inputs]
        steps = [a.size if x.ndim == 2 else 0 for a, x in zip(kernel.inputs, inputs, strict=True)]
        outputs = [np.empty((1 if a.summed else batch.size, a.size)) for a in kernel.outputs]
        pairs = [
            word
            for x, step in zip(inputs, steps, strict=True)
            for word in (ctypes.c_void_p(x.ctypes.data), ctypes.c_long(step))
        ]
        results = [ctypes.c_void_p(out.ctypes.data) for out in outputs]
        timer = self._timers[f"time_{name}"]
        timer.restype = ctypes.c_double

        kept = (*inputs, *outputs)  # the timer knows only their addresses

        def run(calls: int, _kept: tuple[Array, ...] = kept) -> float:
            took = timer(entry, ctypes.c_long(calls), ctypes.c_long(batch.size), *pairs, *results)
            return float(took)

        return run, outputs


def _timer(kernel: KernelFacts) -> str:
    """C that calls one batch function `calls` times and returns nanoseconds per sample."""
    inputs = [f"const double *{a.name}, long {a.name}_step" for a in kernel.inputs]
    outputs = [f"double *{a.name}_out" for a in kernel.outputs]
    given = [f"{a.name}, {a.name}_step" for a in kernel.inputs]
    given += [f"{a.name}_out" for a in kernel.outputs]
    types = ["const double *, long"] * len(inputs) + ["double *"] * len(outputs)
    return f"""
__attribute__((visibility("default")))
double time_{kernel.name}(void (*batch)(long, {", ".join(types)}), long calls, long n,
    {", ".join((*inputs, *outputs))})
{{
    const double from = now();
    for (long k = 0; k < calls; ++k) batch(n, {", ".join(given)});
    return (now() - from) / ((double)calls * n);
}}
"""
