"""Levels that a library needs on this processor alone.

The compiled library decides by cpuid which of its levels runs; here the same is read from the
operating system, before there is a library.
"""

from pathlib import Path

from symgen.build.compile_recipe import LEVELS, PORTABLE
from symgen.build.compiler import accepts_level, find_compiler, machine

_V2 = frozenset({"pni", "ssse3", "cx16", "sse4_1", "sse4_2", "popcnt", "lahf_lm"})
_V3 = _V2 | {"fma", "movbe", "avx", "f16c", "bmi1", "avx2", "bmi2", "abm"}
_V4 = _V3 | {"avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl"}
FLAGS = {"v4": _V4, "v3": _V3, "v2": _V2}
"""Level → flags of /proc/cpuinfo that the x86-64 ABI requires for it."""
FACTS = Path("/proc/cpuinfo")


def levels_of_processor() -> tuple[str, ...]:
    """Best level of this processor that the compiler supports, and the portable one."""
    if machine() == "x86_64":
        flags = _flags()
        if flags is None:
            return ()
        runs = [level for level, needs in FLAGS.items() if needs <= flags]
    else:
        runs = [level for level in LEVELS.get(machine(), PORTABLE) if level not in PORTABLE]
    compiler = find_compiler()
    best = next((level for level in runs if accepts_level(compiler, level)), None)
    return (*([best] if best else []), *PORTABLE)


def _flags() -> set[str] | None:
    """Flags of the first processor; None where the operating system does not list them."""
    try:
        lines = FACTS.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    line = next((line for line in lines if line.startswith("flags")), None)
    return None if line is None else set(line.partition(":")[2].split())
