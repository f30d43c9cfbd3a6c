"""The kernel τ of tiles in single precision, made from the generated C for the sake of comparison.

Other libraries publish single precision. Here the text of the generated kernel is compiled with
`float` in place of `double` and twice the lanes; sines and cosines are stored. The generated
libraries themselves have double precision only.
"""

import ctypes
import re
from pathlib import Path

import numpy as np

from bench.batch import Batch
from bench.compiled import Compiler, compile_shared, open_shared
from bench.front import BenchError
from bench.ours import Contender
from runtime.library import Library

KERNEL = "base_inverse_dynamics"
BYTES = {"v4": 64, "v3": 32}
"""Width of a vector by level; 16 elsewhere."""
_SOURCE = """
#include <time.h>
#define INLINE static inline __attribute__((always_inline))
#define VS 1
#define HIDDEN static
typedef float vd __attribute__((vector_size({bytes})));
typedef float vu __attribute__((vector_size({bytes}), aligned(4)));
INLINE vd vd_all(float x) {{ return x - (vd){{0}}; }}
{lanes}
{prepare}
__attribute__((visibility("default")))
double run(long calls, long tiles, const float *beta, const float *sc, const float *q,
    const float *dq, const float *ddq, float *tau)
{{
    enum {{ N = {joints}, W = {bytes} / 4 }};
    float u[{uniform}];
    struct timespec from, to;
    clock_gettime(CLOCK_MONOTONIC, &from);
    for (long call = 0; call < calls; ++call) {{
        {name}_{kernel}_prepare(beta, u);
        for (long i = 0; i < tiles; ++i) {{
            const long at = i * N * W;
            {kernel}_lanes((const vu *)(sc + 2 * at), (const vu *)(q + at), (const vu *)(dq + at),
                (const vu *)(ddq + at), beta, u, (vu *)(tau + at));
        }}
    }}
    clock_gettime(CLOCK_MONOTONIC, &to);
    return ((to.tv_sec - from.tv_sec) * 1e9 + (to.tv_nsec - from.tv_nsec)) / (double)calls;
}}
"""


def contender(lib: Library, compiler: Compiler, batch: Batch) -> Contender:
    """The kernel in single precision over a batch."""
    size = BYTES.get(lib.level, 16)
    timer = open_shared(
        compile_shared(compiler, _flags(lib.level), _source(lib, size), ".c")[0]
    ).run
    timer.restype = ctypes.c_double
    lanes, n = size // 4, lib.n_joints
    tiles = batch.size // lanes
    sc = np.stack([np.sin(batch.q), np.cos(batch.q)], axis=2).reshape(batch.size, -1)
    inputs = [_as_tiles(x, lanes) for x in (sc, batch.q, batch.dq, batch.ddq)]
    beta = np.ascontiguousarray(batch.beta, dtype=np.float32)
    tau = np.zeros((tiles, n, lanes), dtype=np.float32)
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in (beta, *inputs, tau)]

    def run(calls: int, _kept: object = (beta, *inputs)) -> float:
        return float(timer(ctypes.c_long(calls), ctypes.c_long(tiles), *pointers)) / batch.size

    return Contender(batch.size, run, lambda: tau.transpose(0, 2, 1).reshape(batch.size, n))


def _flags(level: str) -> tuple[str, ...]:
    march = {"v4": "x86-64-v4", "v3": "x86-64-v3"}.get(level, "native")
    return ("-O2", f"-march={march}", "-ffp-contract=fast", "-fsingle-precision-constant")


def _source(lib: Library, size: int) -> str:
    """C of the kernel with `float`."""
    folder = Path(lib.folder)
    lanes = _function(folder / "tiles.c", f"static inline void {KERNEL}_lanes(")
    prepare = _function(folder / "kernels.c", f"void {lib.name}_{KERNEL}_prepare(")
    places = [int(k) for k in re.findall(r"\bu\[(\d+)\] =", prepare)]
    return _SOURCE.format(
        bytes=size,
        lanes=re.sub(r"\bdouble\b", "float", lanes),
        prepare=re.sub(r"\bdouble\b", "float", f"static {prepare}"),
        joints=lib.n_joints,
        uniform=1 + max(places, default=0),
        name=lib.name,
        kernel=KERNEL,
    )


def _function(path: Path, head: str) -> str:
    """Text of one function of generated C, from its head to the brace that ends it."""
    text = path.read_text(encoding="utf-8")
    for start in (match.start() for match in re.finditer(re.escape(head), text)):
        end = text.find("\n}\n", start)
        if ";" not in text[start : text.find("\n", start)].rstrip("{"):
            return text[start : end + 3]
    raise BenchError(f"{path.name} holds no function that begins with {head!r}; build the robot")


def _as_tiles(x: np.ndarray, lanes: int) -> np.ndarray:
    """(N, size) → (N / lanes, size, lanes) in single precision."""
    tiles = x.reshape(-1, lanes, x.shape[1]).transpose(0, 2, 1)
    return np.ascontiguousarray(tiles, dtype=np.float32)
