"""C sources → shared library: flags and levels, choice of the compiler, the exact commands.

`how_to_compile` is what compile.json states. The compiled library decides by cpuid which of its
levels runs; `levels_of_processor` reads the same from the operating system before there is one.
"""

import os
import shlex
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.common.compiler import (
    accepts,
    compile_commands,
    compiler_version,
    find_compiler,
    machine,
    run,
    spelled,
)
from runtime.common.errors import CompilerError
from runtime.common.files import sha256_of

_V2 = frozenset({"pni", "ssse3", "cx16", "sse4_1", "sse4_2", "popcnt", "lahf_lm"})
_V3 = _V2 | {"fma", "movbe", "avx", "f16c", "bmi1", "avx2", "bmi2", "abm"}
_V4 = _V3 | {"avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl"}
PROCESSOR_FLAGS = {"v4": _V4, "v3": _V3, "v2": _V2}  # by the x86-64 ABI, of /proc/cpuinfo
CPUINFO = Path("/proc/cpuinfo")

FLAGS = ("-std=c99", "-fPIC", "-fno-math-errno", "-fno-trapping-math")
"""Flags of all sources. -ffast-math would break range reduction and the handling of NaN.

Warnings are off: the tests compile with all of them, and they cost GCC a second.
"""
PLAIN = ("-O1",)  # level for code on one or two numbers at a time, which gains nothing from more
WIDE = ("-O2",)  # level for code on wide vectors
VECTOR_FLAGS = (
    "-ffp-contract=fast",  # fused multiply-add, which ISO C turns off by itself
    "-fno-tree-vectorize",  # the vectors are there already; looking for more costs compile time
    "-fno-tree-slp-vectorize",
)
QUICK = ("-DQUICK",)  # functions of kernels.c that no loop calls are compiled without optimisation
FALLBACK = ("-O0", "-DBY_SAMPLE")
"""The portable level beside a better one, which processors that lack the better one load.

Its tiles call the functions of one sample lane by lane, instead of having all kernels once more."""
GCC_PLAIN = ("-fno-tree-dse", "--param=lra-max-considered-reload-pseudos=20")
"""Passes that GCC skips at -O1, see `GCC_WIDE`."""
GCC_ONCE = (*GCC_PLAIN, "-fno-dse")  # passes that GCC skips for sums and products of numbers alone
GCC_WIDE = (
    *(*GCC_PLAIN, "-fno-ira-share-spill-slots", "-fira-region=one", "-fno-tree-copy-prop"),
    *("-fno-tree-dominator-opts", "-fno-tree-ccp", "-fno-tree-fre", "-fno-tree-pta"),
    *("-fno-tree-vrp", "-fno-tree-pre", "-fno-forward-propagate", "-fno-code-hoisting"),
    *("-fno-ipa-icf", "-fno-ipa-modref", "-fno-ipa-sra", "-fno-cprop-registers"),
    *("-fno-rerun-cse-after-loop", "-fno-ree"),
)
"""Passes that GCC skips at -O2.

They change nothing in straight-line code of single assignments and take a third of the time. Torque
kernels become 5 % faster, those that store blocks of Jacobians up to 4 % slower. Passes that must
stay: without -fdse at -O2 tiles are stored a quarter slower, without -fipa-cp they are loaded a
tenth slower. -O1 in place of -O2 makes kernels up to 40 % slower.
"""
PORTABLE = {"portable": (1, "")}  # level that every machine has: one lane, no instruction set
LEVELS = {  # machine → level → (lanes, -march). A vector wider than the instruction set is slow.
    "x86_64": {"v4": (8, "x86-64-v4"), "v3": (4, "x86-64-v3"), "v2": (2, "x86-64-v2"), **PORTABLE},
    "aarch64": {"neon": (2, ""), **PORTABLE},
}
LINK = ("-shared", "-lm")
REFERENCE = "casadi"  # level of CasADi's code, compiled without optimisation for comparison


@dataclass(frozen=True, slots=True)
class Compiled:
    """Commands that were run, version of the compiler, and hash of the library."""

    commands: tuple[tuple[str, ...], ...]
    version: str
    sha256: str


def compile_library(
    folder: Path, how: Mapping[str, Any], wanted: Sequence[str], target: Path
) -> Compiled:
    """Compile the C files of a folder for some levels, or all of this machine, on all cores."""
    compiler = find_compiler()
    _require_levels(wanted, compiler)
    *commands, link = compile_commands(how, wanted or level_names(), compiler, folder, target)
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        list(pool.map(lambda command: run(command, folder), commands))
    finally:
        pool.shutdown(cancel_futures=True)
    run(link, folder)
    for command in commands:
        (folder / command[-1]).unlink()
    return Compiled((*commands, link), compiler_version(compiler), sha256_of(target))


def level_names() -> tuple[str, ...]:
    """Every level that can be compiled on this machine, the best first."""
    return (*LEVELS.get(machine(), PORTABLE), REFERENCE)


def _require_levels(wanted: Sequence[str], compiler: tuple[str, ...]) -> None:
    for name in wanted:
        if name not in level_names():
            raise CompilerError(
                f"there is no level '{name}' on {machine()}; its levels are "
                f"{', '.join(level_names())}"
            )
        if name != REFERENCE and not accepts_level(compiler, name):
            raise CompilerError(
                f"'{shlex.join(compiler)}' cannot compile for the level '{name}'; "
                "leave it out or install a newer compiler"
            )
    if wanted and not set(wanted) - {REFERENCE}:
        raise CompilerError(
            f"'{REFERENCE}' is only the reference of the other levels; "
            f"add one of {', '.join(level_names()[:-1])}"
        )


def accepts_level(compiler: tuple[str, ...], level: str) -> bool:
    """Return whether a compiler knows the instruction set of a level."""
    _, architecture = LEVELS.get(machine(), PORTABLE)[level]
    return not architecture or accepts(compiler, [spelled(f"-march={architecture}", compiler)])


def how_to_compile(
    once: Sequence[str], per_level: Sequence[str] = (), unhurried: Sequence[str] = ()
) -> dict[str, Any]:
    """Flags of all files, of groups by level and machine, and of the link; JSON-ready."""

    def group(sources: Sequence[str], flags: Sequence[str], level: str = "", of: str = "") -> Any:
        plain = GCC_PLAIN if level else GCC_ONCE
        spared = plain if PLAIN[0] in flags else GCC_WIDE if WIDE[0] in flags else ()
        lists = {"sources": [*sources], "flags": [*flags], "gcc": [*spared]}
        return {"level": level, "machine": of, **lists, "beside": [*FALLBACK * (level in PORTABLE)]}

    groups = [group(once, (*PLAIN, *QUICK))]
    for name, levels in (*LEVELS.items(), ("", PORTABLE)):
        for level, (width, architecture) in levels.items():
            if name and level in PORTABLE:
                continue
            flags = [*(WIDE if width > 2 else PLAIN), f"-DLEVEL={level}", f"-DW={width}"]
            march = [f"-march={architecture}"] if architecture else []
            groups.append(group(per_level, [*flags, *VECTOR_FLAGS, *march], level, name))
    groups.append(group(unhurried, ("-O0",), REFERENCE))
    return {
        "flags": [*FLAGS],
        "groups": [entry for entry in groups if entry["sources"]],
        "link": [*LINK],
    }


def levels_of_processor() -> tuple[str, ...]:
    """Best level of this processor that the compiler supports, and the portable one."""
    if machine() == "x86_64":
        flags = _flags()
        if flags is None:
            return ()
        runs = [level for level, needs in PROCESSOR_FLAGS.items() if needs <= flags]
    else:
        runs = [level for level in LEVELS.get(machine(), PORTABLE) if level not in PORTABLE]
    compiler = find_compiler()
    best = next((level for level in runs if accepts_level(compiler, level)), None)
    return (*([best] if best else []), *PORTABLE)


def _flags() -> set[str] | None:
    """Flags of the first processor; None where the operating system does not list them."""
    try:
        lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    line = next((line for line in lines if line.startswith("flags")), None)
    return None if line is None else set(line.partition(":")[2].split())
