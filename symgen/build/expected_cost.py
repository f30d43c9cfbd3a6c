"""What a compilation will cost, from the number of operations of the kernels.

    CPU time = Σ over levels (fixed + operations · rate)
    memory of one process = fixed + operations · rate

Times are fitted to GCC 12 on one x86-64 core with arms of 1 and 7 joints (6188 and 57111
instructions), which they reproduce to 5 %; other machines differ by their speed. Memory is that of
this process and of the compilers that run at the same time (proportional set sizes): 153, 333, 340
and 507 MB for a two-link arm, a Go2, an FR3 and a Talos of 8309, 55516, 55821 and 189288
instructions, which it reproduces within a factor of 1.3.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from symgen.build.compile_recipe import PORTABLE, REFERENCE
from symgen.build.compiler import level_names
from symgen.kernel import Kernel

_ONCE = (0.45, 4.2e-5)
"""Sources of no level: seconds, and seconds per instruction."""
_PER_LEVEL = {
    "v4": (2.5, 3.7e-5),
    "v3": (2.3, 3.9e-5),
    "v2": (2.2, 4.2e-5),
    "neon": (2.2, 4.2e-5),
    "portable": (2.0, 4.2e-5),
    REFERENCE: (0.15, 3.7e-5),
}
_FALLBACK = (0.45, 2e-6)
"""The portable level beside a better one."""
_COMPILER_MB = (55.0, 9e-4)
"""Memory of one compiler process: MB, and MB per instruction."""
_PYTHON_MB = (65.0, 6e-4)
"""Memory of this process while others compile: MB, and MB per instruction."""


@dataclass(frozen=True, slots=True)
class ExpectedCost:
    """Size of the kernels and what their compilation takes.

    Attributes:
        operations: instructions of all kernels.
        cpu_s: CPU time of all compilers [s].
        memory_mb: largest memory at one time [MB].
        levels: what is compiled, the best first.
    """

    operations: int
    cpu_s: float
    memory_mb: float
    levels: tuple[str, ...]

    def __str__(self) -> str:
        """One sentence for the user."""
        return (
            f"{self.operations} operations; expected {self.cpu_s:.0f} s of CPU and "
            f"{self.memory_mb:.0f} MB of memory for the levels {', '.join(self.levels)}"
        )


def expected_cost(
    kernels: Iterable[Kernel], levels: Sequence[str], cores: int | None = None
) -> ExpectedCost:
    """Return the expected cost of the compilation of some kernels."""
    operations = sum(len(kernel.instructions) for kernel in kernels)
    wanted = tuple(name for name in level_names() if not levels or name in levels)
    is_fallback = bool({*wanted} - {*PORTABLE, REFERENCE})
    of_level = _PER_LEVEL | (dict.fromkeys(PORTABLE, _FALLBACK) if is_fallback else {})
    pairs = (_ONCE, *(of_level[name] for name in wanted))
    at_once = min(cores or os.cpu_count() or 1, 4)  # of the files four are large
    return ExpectedCost(
        operations,
        sum(fixed + rate * operations for fixed, rate in pairs),
        expected_memory(operations, at_once),
        wanted,
    )


def expected_memory(operations: int, at_once: int) -> float:
    """Largest memory of this process and its compilers."""
    process, compiler = (fixed + rate * operations for fixed, rate in (_PYTHON_MB, _COMPILER_MB))
    return process + at_once * compiler
