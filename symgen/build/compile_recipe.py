"""Flags of every generated source, its levels, and the recipe that compile.json states."""

from collections.abc import Sequence
from typing import Any

FLAGS = (
    "-std=c99",
    "-fPIC",
    "-fno-math-errno",
    "-fno-trapping-math",
)
"""Flags of all sources. -ffast-math would break range reduction and the handling of NaN.

Warnings are off: the tests compile with all of them, and they cost GCC a second.
"""

PLAIN = ("-O1",)
"""Level for code on one or two numbers at a time, which gains nothing from more (measured)."""
WIDE = ("-O2",)
"""Level for code on wide vectors."""
VECTOR_FLAGS = (
    "-ffp-contract=fast",  # fused multiply-add, which ISO C turns off by itself
    "-fno-tree-vectorize",  # the vectors are there already; looking for more costs compile time
    "-fno-tree-slp-vectorize",
)

QUICK = ("-DQUICK",)
"""The functions of kernels.c that no loop calls are compiled without optimisation."""
FALLBACK = ("-O0", "-DBY_SAMPLE")
"""The portable level beside a better one, which processors that lack the better one load.

Its tiles call the functions of one sample lane by lane, instead of having all kernels once more."""

GCC_PLAIN = ("-fno-tree-dse", "--param=lra-max-considered-reload-pseudos=20")
"""Passes that GCC skips at -O1, see `GCC_WIDE`."""
GCC_ONCE = (*GCC_PLAIN, "-fno-dse")
"""Passes that GCC skips where nothing but sums and products of numbers is compiled."""
GCC_WIDE = (
    *GCC_PLAIN,
    "-fno-ira-share-spill-slots",
    "-fira-region=one",
    "-fno-tree-copy-prop",
    "-fno-tree-dominator-opts",
    "-fno-tree-ccp",
    "-fno-tree-fre",
    "-fno-tree-pta",
    "-fno-tree-vrp",
    "-fno-tree-pre",
    "-fno-forward-propagate",
    "-fno-code-hoisting",
    "-fno-ipa-icf",
    "-fno-ipa-modref",
    "-fno-ipa-sra",
    "-fno-cprop-registers",
    "-fno-rerun-cse-after-loop",
    "-fno-ree",
)
"""Passes that GCC skips at -O2.

They change nothing in straight-line code of single assignments and take a third of the time. Torque
kernels become 5 % faster, those that store blocks of Jacobians up to 4 % slower. Passes that must
stay: without -fdse at -O2 tiles are stored a quarter slower, without -fipa-cp they are loaded a
tenth slower. -O1 in place of -O2 makes kernels up to 40 % slower.
"""

PORTABLE = {"portable": (1, "")}
"""Level that every machine has: one lane, no instruction set."""
LEVELS = {
    "x86_64": {"v4": (8, "x86-64-v4"), "v3": (4, "x86-64-v3"), "v2": (2, "x86-64-v2"), **PORTABLE},
    "aarch64": {"neon": (2, ""), **PORTABLE},
}
"""Machine → level → (lanes, -march). A vector wider than the instruction set is slow."""

LINK = ("-shared", "-lm")

REFERENCE = "casadi"
"""Level of the code that CasADi generates, compiled without optimisation for comparison."""


def how_to_compile(
    once: Sequence[str], per_level: Sequence[str] = (), unhurried: Sequence[str] = ()
) -> dict[str, Any]:
    """Flags of all files, groups of files with further flags, and flags of the link; JSON-ready.

    A group has the level that it belongs to, the machine that it is for ("" means all), flags
    that only GCC takes, and flags that are added where a better level is compiled as well.
    """

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
