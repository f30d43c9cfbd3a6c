"""C that is compiled for a measurement, limits of one core, interleaved rounds on a noisy machine.

Of measurements the best of each round counts, and medians over rounds.
"""

import ctypes
import platform
import tempfile
from collections.abc import Callable, Hashable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from runtime.common.compiler import machine
from runtime.library import Array
from runtime.library.compile_cache import compiled_file


def compiled(name: str, source: str, *flags: str) -> ctypes.CDLL:
    """Library of a C text, compiled once for this machine."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.c"
        path.write_text(source, encoding="utf-8")
        return ctypes.CDLL(str(compiled_file(path, flags)))


Key = TypeVar("Key", bound=Hashable)

BURST = 3e5  # nanoseconds of one measurement, after one call that is not timed
PASSES = 5  # measurements per contender and round; the smallest counts, because noise only adds


def interleave(
    contenders: Mapping[Key, Callable[[], float]], rounds: int, passes: int = PASSES
) -> dict[Key, Array]:
    """The smallest of `passes` measurements per round, (rounds,) each.

    Everybody is measured once before anybody is measured again, so that what drifts, drifts for
    all; compare numbers of the same round only.
    """
    for measure in contenders.values():
        measure()
    times = {key: np.full(rounds, np.inf) for key in contenders}
    for k in range(rounds):
        for _ in range(passes):
            for key, measure in contenders.items():
                times[key][k] = min(times[key][k], measure())
    return times


def ratio(theirs: Array, ours: Array) -> float:
    """Median over rounds of the ratios of the same round."""
    return float(np.median(theirs / ours))


def burst(run: Callable[[int], float], samples: int) -> Callable[[], float]:
    """`run(calls)` → ns per sample, with as many calls as fill a burst."""
    run(1)  # warms up
    calls = max(1, round(BURST / (run(1) * samples)))

    def once() -> float:
        run(1)
        return run(calls)

    return once


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


def limits(levels: tuple[str, ...]) -> dict[str, Callable[[], float]]:
    """Per level, a measurement of ns per operation of one core; a multiply-add counts two.

    Levels without fused multiply-add (portable, v2) have the limit of separate instructions.
    """
    measures = {}
    for level in levels:
        width, march = WIDTHS[level]
        kind = "v" if level == "v4" else "x" if machine() == "x86_64" else "w"
        keep = f'-DKEEP(x)=__asm__ volatile("" : "+{kind}"(x))'
        flags = ("-ffp-contract=fast", *march, f"-DW={width}", keep)
        function = compiled("limit", _SOURCE, *flags)["limit"]
        function.argtypes, function.restype = (ctypes.c_long,), ctypes.c_double
        measures[level] = partial(function, 20_000)
    return measures


def processor() -> str:
    """Name of the processor as the system states it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
