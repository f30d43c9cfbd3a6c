"""Kernels on microcontrollers: text and stack by GCC, instructions and digits under QEMU.

Instructions are counted by QEMU's virtual clock (-icount shift=0: one per nanosecond), which the
firmware reads from SysTick, over many calls. They are no cycles: caches, wait states and the
latency of the units come on top.
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.front import BenchError, Sheet, sheet_of
from runtime.library import Library
from symgen.make.pipeline import write_controller
from symgen.make.request import bundled_request

KERNELS = ("inverse_dynamics", "bias_forces", "mass_matrix", "forward_dynamics", "end_effector")
CORES = {
    "M4": ("mps2-an386", ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")),
    "M7": ("mps2-an500", ("-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard")),
}
"""Core → board of QEMU, and flags; the M4 computes double precision in software."""
BOUND = {"single": 2e-5, "double": 1e-12}
"""Largest error, relative to the largest number."""
FLAGS = ("-mthumb", "-O2", "-std=c99", "-Wall", "-Wextra", "-Werror")
CALLS = 50
TICK = 40
"""Instructions per tick of SysTick: 25 MHz."""
LINK = """MEMORY { FLASH : ORIGIN = 0, LENGTH = 4M  RAM : ORIGIN = 0x20000000, LENGTH = 4M }
ENTRY(reset)
SECTIONS {
  .text : { KEEP(*(.vectors)) KEEP(*(.init)) KEEP(*(.fini)) *(.text*) *(.rodata*)
    *(.init_array*) *(.fini_array*) *(.eh_frame*) } > FLASH
  .ARM.exidx : { *(.ARM.exidx*) } > FLASH
  .data : { *(.data*) } > RAM
  .bss : { __bss_start__ = .; *(.bss*) *(COMMON) __bss_end__ = .; } > RAM
  end = .; __end__ = .;
}
"""
START = """#include <stdio.h>
#include "%s.h"
void reset(void);
extern int _start(void);
__attribute__((section(".vectors"), used)) static void *const vectors[16]
    = {(void *)0x20400000, (void *)reset};
void reset(void)
{
    *(volatile unsigned *)0xE000ED88 |= 0xFu << 20; /* the floating-point unit */
    __asm__ volatile("dsb\\n isb");
    _start();
}
#define SYSTICK ((volatile unsigned *)0xE000E010)
int main(void)
{
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
"""


def measure(lib: Library) -> Sheet:
    """Every kernel in both precisions on both cores: bytes without <math.h>, and instructions."""
    for tool in ("arm-none-eabi-gcc", "qemu-system-arm"):
        if shutil.which(tool) is None:
            raise BenchError(
                f"expected {tool}, got none; on Debian: apt-get install gcc-arm-none-eabi "
                "libnewlib-arm-none-eabi qemu-system-arm"
            )
    rows = []
    with tempfile.TemporaryDirectory() as place:
        for kernel in KERNELS:
            for precision in BOUND:
                root = Path(place) / kernel / precision
                request = bundled_request(lib.name)
                folder = write_controller(request, root, [kernel], precision, False)
                costs = [_cost(lib, folder, kernel, precision, core) for core in CORES]
                rows.append((kernel, precision, *(value for cost in costs for value in cost)))
    parts = [f"{core}: {what}" for core in CORES for what in ("text", "stack", "instructions")]
    columns = {"kernel": "", "precision": ""} | dict.fromkeys(parts, ",")
    return sheet_of("check_mcu", columns, rows, title="Kernels on microcontrollers")


def _cost(lib: Library, folder: Path, kernel: str, precision: str, core: str) -> tuple[int, ...]:
    """Text and stack in bytes, and instructions."""
    board, target = CORES[core]
    inputs = _inputs(lib, kernel)
    _run(folder, "arm-none-eabi-gcc", *target, *FLAGS, "-fstack-usage", "-c", f"{lib.name}.c")
    sizes = _run(folder, "arm-none-eabi-size", f"{lib.name}.o").splitlines()[1].split()
    frames = {
        line.split("\t")[0].rsplit(":", 1)[1]: int(line.split("\t")[1])
        for line in (folder / f"{lib.name}.su").read_text().splitlines()
    }
    outer = frames.pop(f"{lib.name}_{kernel}")
    (folder / "main.c").write_text(_firmware(lib, kernel, precision, inputs))
    (folder / "link.ld").write_text(LINK)
    words = (*FLAGS, "main.c", f"{lib.name}.o", "-T", "link.ld", "--specs=rdimon.specs", "-lm")
    _run(folder, "arm-none-eabi-gcc", *target, *words, "-o", "run.elf")
    quiet = ("-nographic", "-monitor", "none", "-serial", "null", "-semihosting")
    board_words = ("-M", board, "-icount", "shift=0", "-kernel", "run.elf")
    answer = _run(folder, "qemu-system-arm", *board_words, *quiet)
    ticks, *numbers = map(float, answer.split())
    exact = np.ravel(getattr(lib, kernel)(*inputs.values()))
    error = np.abs(np.array(numbers) - exact).max() / np.abs(exact).max()
    if not error <= BOUND[precision]:
        raise BenchError(f"{kernel} on {core} differs from the library by {error:.1e}")
    stack = outer + max(frames.values(), default=0)
    return int(sizes[0]), stack, round(ticks * TICK / CALLS)


def _inputs(lib: Library, kernel: str) -> dict[str, Any]:
    rng = np.random.default_rng(4)
    known = {"pi": lib.pi0, "rotor": np.full(lib.n_joints, 0.1)}
    facts = lib.manifest.kernels[kernel]
    return {a.name: known.get(a.name, rng.uniform(-1, 1, a.size)) for a in facts.inputs}


def _firmware(lib: Library, kernel: str, precision: str, inputs: dict[str, Any]) -> str:
    number = {"single": "float", "double": "double"}[precision]
    text = START % lib.name
    for name, values in inputs.items():
        text += f"    const {number} {name}[] = {{{', '.join(repr(float(x)) for x in values)}}};\n"
    (output,) = lib.manifest.kernels[kernel].outputs
    given = ", ".join([*inputs, "result"])
    return (
        text
        + f"""    {number} result[{output.size}];
    const unsigned before = SYSTICK[2];
    for (int k = 0; k < {CALLS}; ++k) {{
        {lib.name}_{kernel}({given});
        __asm__ volatile("" ::: "memory");
    }}
    printf("%u", (before - SYSTICK[2]) & 0xFFFFFF);
    for (int k = 0; k < {output.size}; ++k) {{
        printf(" %.17g", (double)result[k]);
    }}
    return 0;
}}
"""
    )


def _run(folder: Path, *command: str) -> str:
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, timeout=120
    )
    if done.returncode:
        problem = re.sub(r"\s+", " ", done.stderr or done.stdout)[-700:]
        raise BenchError(f"{command[0]} refused: {problem}")
    return done.stdout
