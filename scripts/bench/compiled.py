"""Compiled helpers, limits of one core, and interleaved measurements on a noisy machine.

A library lies under ~/.cache/symgen/bench/<hash of source, flags, compiler and versions>.so, so
that Pinocchio's templates, a minute of compilation, are paid for once. Of measurements the best of
each round counts, and medians over rounds.
"""

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from bench.front import BenchError
from runtime.library import Array

CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "symgen" / "bench"


@dataclass(frozen=True, slots=True)
class Compiler:
    """A command and the first line of its `--version`."""

    command: str
    version: str


def find(names: tuple[str, ...]) -> Compiler:
    """The first compiler of the PATH."""
    for name in names:
        if shutil.which(name):
            version = subprocess.run(
                [name, "--version"], capture_output=True, text=True, check=True
            )
            return Compiler(name, version.stdout.splitlines()[0])
    raise BenchError(f"none of the compilers {', '.join(names)} is on the PATH")


def compile_shared(
    compiler: Compiler, flags: tuple[str, ...], source: str, suffix: str, versions: str = ""
) -> tuple[Path, str]:
    """Path of the cached library of `source`, and the command that makes it."""
    key = "\n".join((source, *flags, compiler.version, versions, _processor()))
    target = CACHE / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.so"
    command = (compiler.command, *flags, "-shared", "-fPIC", "-fvisibility=hidden")
    shown = shlex.join((*command, f"source{suffix}", "-o", target.name))
    if not target.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=CACHE) as folder:
            path, library = Path(folder) / f"source{suffix}", Path(folder) / "out.so"
            path.write_text(source, encoding="utf-8")
            run = subprocess.run(
                [*command, str(path), "-o", str(library)],
                capture_output=True,
                text=True,
                check=False,
            )
            if run.returncode != 0:
                errors = [line for line in run.stderr.splitlines() if "error" in line]
                complaint = (errors or run.stderr.splitlines() or ["no message"])[0]
                raise BenchError(f"{compiler.command} refused: {complaint[:300]}")
            library.replace(target)  # appears whole or not at all
    return target, shown


def open_shared(path: Path) -> ctypes.CDLL:
    """The library; a broken one is deleted from the cache."""
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        path.unlink(missing_ok=True)
        raise BenchError(f"the compiled helper cannot be loaded ({error}); run again") from None


def _processor() -> str:
    """Processor features on which -march=native depends."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return "".join(dict.fromkeys(s for s in lines if s.startswith(("model name", "flags"))))


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
