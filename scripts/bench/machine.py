"""Limits of one core: clock, multiply-adds at each vector width, name."""

import ctypes
import platform
from collections.abc import Callable
from pathlib import Path

from bench.compiled import Compiler, compile_shared, open_shared

WIDTHS = {
    "portable": (1, ()),
    "v2": (2, ("-march=x86-64-v2",)),
    "v3": (4, ("-march=x86-64-v3",)),
    "v4": (8, ("-march=x86-64-v4",)),
    "neon": (2, ()),
}
"""Level → lanes and instruction set of its limit."""

_CHAINS = 12
"""Independent accumulators: enough for 2 units × 4 to 6 cycles of latency, few enough for 16
registers."""

_SOURCE = """\
#include <time.h>
#if W == 1
typedef double vd;
#define LANE(x, l) (x)
#define ALL(value) (value)
#else
typedef double vd __attribute__((vector_size(8 * W)));
#define LANE(x, l) (x)[l]
#define ALL(value) ((value) - (vd){{0}})
#endif
__attribute__((visibility("default"))) double limit(long rounds)
{{
    struct timespec from, to;
    volatile double seed = 0.999999;
    vd a = ALL(seed), b = ALL(1.0 - seed);
    {start}
    clock_gettime(CLOCK_MONOTONIC, &from);
    for (long i = 0; i < rounds; ++i) {{
        {step}
    }}
    clock_gettime(CLOCK_MONOTONIC, &to);
    const vd sum = {total};
    volatile double sink = 0;
    for (int l = 0; l < W; ++l) sink += LANE(sum, l);
    const double ns = (to.tv_sec - from.tv_sec) * 1e9 + (to.tv_nsec - from.tv_nsec);
    return ns / ({chains}.0 * 2 * W * rounds);
}}
""".format(
    start=" ".join(f"vd x{k} = a * {k + 1}.0;" for k in range(_CHAINS)),
    step="\n        ".join(f"x{k} = x{k} * a + b; KEEP(x{k});" for k in range(_CHAINS)),
    total=" + ".join(f"x{k}" for k in range(_CHAINS)),
    chains=_CHAINS,
)
"""x ← x a + b in independent chains, each kept in a register by an empty asm statement."""


_CLOCK = """\
#include <time.h>
__attribute__((visibility("default"))) double cycle(long rounds)
{
    struct timespec from, to;
    volatile unsigned long seed = 5;
    unsigned long x = seed, y = seed;
    clock_gettime(CLOCK_MONOTONIC, &from);
    for (long i = 0; i < rounds; ++i) {
        STEPS
    }
    clock_gettime(CLOCK_MONOTONIC, &to);
    seed = x;
    return ((to.tv_sec - from.tv_sec) * 1e9 + (to.tv_nsec - from.tv_nsec)) / (64.0 * rounds);
}
""".replace("STEPS", " ".join(['x ^= y; __asm__ volatile("" : "+r"(x));'] * 64))
"""An exclusive or takes one cycle, and each of these waits for the one before."""


def cycle(compiler: Compiler) -> Callable[[], float]:
    """A measurement of one cycle of the core in ns."""
    path, _ = compile_shared(compiler, ("-O2",), _CLOCK, ".c")
    function = open_shared(path)["cycle"]
    function.argtypes, function.restype = (ctypes.c_long,), ctypes.c_double
    return lambda: float(function(5_000))


def limits(compiler: Compiler, levels: tuple[str, ...]) -> dict[str, Callable[[], float]]:
    """Per level, a measurement of ns per operation of one core; a multiply-add counts two.

    Levels without fused multiply-add (portable, v2) have the limit of separate instructions.
    """
    register = "x" if platform.machine().lower() in {"x86_64", "amd64"} else "w"
    measures = {}
    for level in levels:
        width, march = WIDTHS[level]
        kind = "v" if level == "v4" else register
        flags = (
            "-O2",
            "-ffp-contract=fast",
            *march,
            f"-DW={width}",
            f'-DKEEP(x)=__asm__ volatile("" : "+{kind}"(x))',
        )
        path, _ = compile_shared(compiler, flags, _SOURCE, ".c")
        function = open_shared(path)["limit"]
        function.argtypes, function.restype = (ctypes.c_long,), ctypes.c_double
        measures[level] = _bound(function)
    return measures


def _bound(function: Callable[[int], float]) -> Callable[[], float]:
    return lambda: function(20_000)


def processor() -> str:
    """Name of the processor as the system states it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
