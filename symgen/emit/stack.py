"""Upper bounds for the stack of the emitted functions, for any compiler.

A straight-line function keeps at most each value, argument and buffer on the stack once: a compiler
may share places, but never needs more. Bounds are for the deepest chain of calls within a
file; functions of the C library come on top.
"""

import re
from dataclasses import dataclass

from symgen.emit.forms import Forms, composed_numbers, compositions
from symgen.emit.sample import ReferenceCode
from symgen.emit.ssa import TileProgram
from symgen.kernel import Kernel

NUMBER = 8
"""Bytes of a double."""
ROW = 64
"""Bytes of one row of a tile."""
BLOCK = 4
"""Tiles whose sines are computed together."""
FRAMES = 4096
"""Bytes of saved registers, alignment and loop counters of all functions in a chain of calls.

Includes the W × W numbers that lanes.h transposes in registers, all spilled.
"""
INLINED = {"sincos": 40, "exp": 24, "all": 0}
"""Values of a function of lanes.h or sines.h that may be inlined; others have two."""


@dataclass(frozen=True, slots=True)
class StackBounds:
    """Bytes per kernel."""

    one: dict[str, int]  # the function of kernels.c
    reference: dict[str, int]  # the loop of reference.c and the functions it calls
    # lanes W → the deeper one of `_batch` and `_tiles`, with the functions they call
    tiles: dict[int, dict[str, int]]


def stack_bounds(
    kernels: tuple[Kernel, ...], forms: Forms, reference: ReferenceCode
) -> StackBounds:
    """Bounds for every kernel and every vector width."""
    by_name = {k.name: k for k in kernels}
    composed = {k.name: NUMBER * composed_numbers(k, by_name) for k in compositions(by_name)}
    one = {k: FRAMES + NUMBER * _values(lines) for k, lines in forms.bodies.items()}
    for name, images in composed.items():
        one[name] += images + max(one[called] for called in by_name[name].through)
    for name, p in forms.products.items():
        factors = p.joints * p.links * p.size + p.size + p.size**2
        one[name] = FRAMES + NUMBER * factors + max(one[p.regressor], one[p.block])
    tiles: dict[int, dict[str, int]] = {}
    for w in (1, 2, 4, 8):
        tiles[w] = {k.name: _tiles(k, forms.tiles[k.name], w) for k in kernels if not k.rare}
        for name, p in forms.products.items():
            if by_name[name].rare:
                continue
            tiles[w][name] += ROW * p.joints * p.links * p.size + tiles[w][p.regressor]
        for name, images in composed.items():
            *maps, last = by_name[name].through
            tiles[w][name] += images + max([tiles[w][last], *(one[called] for called in maps)])
    return StackBounds(
        {k.name: one[k.name] + NUMBER * _arguments(k) for k in kernels},
        {
            k.name: _reference(k, reference.bodies[k.name])
            for k in kernels
            if k.name in reference.bodies
        },
        tiles,
    )


def _values(lines: list[str]) -> int:
    """Named values, and one per operation or call within an expression."""
    text = "\n".join(lines)
    operators = sum(text.count(f" {sign}") for sign in "-+*/<=!&|?")
    operators -= text.count("= -") + text.count("; ++")  # signs and loop counters
    return len(lines) + operators + text.count("(-") + len(_CALLED.findall(text))


def _arguments(kernel: Kernel) -> int:
    return len(kernel.inputs) + len(kernel.outputs)


def _reference(kernel: Kernel, body: str) -> int:
    summed = sum(a.size for a in kernel.outputs if a.summed)
    values = sum(line.count(",") + 1 for line in _DECLARED.findall(body))
    return FRAMES + NUMBER * (values + summed + 3 * _arguments(kernel))


def _tiles(kernel: Kernel, program: TileProgram, width: int) -> int:
    per_sample = [a for a in kernel.inputs if not a.shared]
    rows = sum(a.size * (2 if a.summed else 1) for a in kernel.outputs)
    for argument in per_sample:
        rows += argument.size * (3 * BLOCK if argument.name == program.turned else 1)
    values = sum(line.startswith("const vd") for line in program.body)
    called = _CALL.findall("\n".join(program.body))
    body = NUMBER * width * (values + sum(INLINED.get(name, 2) for name in called))
    prepare = NUMBER * len(program.prepare)
    fixed = ROW * rows + NUMBER * (program.uniform + 4 * _arguments(kernel))
    return FRAMES + fixed + max(body, prepare)


_DECLARED = re.compile(r"^  casadi_real (a\d.*);$", re.MULTILINE)
_CALLED = re.compile(r"\w\(")
_CALL = re.compile(r"\bvd_(\w+)\(")
