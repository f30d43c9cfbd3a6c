"""How much stack the emitted functions take at most, whatever compiler compiles them.

A straight-line function cannot keep more on the stack than each of its named values, its
arguments and its buffers once: a compiler shares places, it never needs more of them. Bounds are
for the deepest chain of calls within a file; the C library's functions come on top.
"""

import re
from dataclasses import dataclass

from symgen.emit.composition import composed_numbers, compositions
from symgen.emit.forms import Forms
from symgen.emit.reference import ReferenceCode
from symgen.emit.ssa import TileProgram
from symgen.kernel import Kernel

NUMBER = 8
ROW = 64
"""Bytes of one row of a tile."""
BLOCK = 4
"""Tiles whose sines are computed together."""
FRAMES = 4096
"""Saved registers, alignment and loop counters of all functions on the way, and W x W numbers
turned in registers by lanes.h, spilled whole."""
INLINED = {"sincos": 40, "exp": 24, "all": 0}
"""Values of a function of lanes.h that a body may take in; those not named here have two."""


@dataclass(frozen=True, slots=True)
class StackBounds:
    """Bytes per kernel.

    Attributes:
        one: the function of kernels.c.
        reference: the loop of reference.c and what it calls.
        tiles: lanes W → the deeper one of `_batch` and `_tiles` and what it calls.
    """

    one: dict[str, int]
    reference: dict[str, int]
    tiles: dict[int, dict[str, int]]


def stack_bounds(
    kernels: tuple[Kernel, ...], forms: Forms, reference: ReferenceCode
) -> StackBounds:
    """Bounds for every kernel and every width of a vector."""
    by_name = {k.name: k for k in kernels}
    composed = {k.name: NUMBER * composed_numbers(k, by_name) for k in compositions(by_name)}
    one = {k: FRAMES + NUMBER * len(lines) for k, lines in forms.bodies.items()}
    for name, own in composed.items():
        one[name] += own + max(one[called] for called in by_name[name].through)
    for name, p in forms.products.items():
        own = p.joints * p.links * p.size + p.size + p.size**2
        one[name] = FRAMES + NUMBER * own + max(one[p.regressor], one[p.block])
    tiles: dict[int, dict[str, int]] = {}
    for w in (1, 2, 4, 8):
        tiles[w] = {k.name: _tiles(k, forms.tiles[k.name], w) for k in kernels if not k.rare}
        for name, p in forms.products.items():
            tiles[w][name] += ROW * p.joints * p.links * p.size + tiles[w][p.regressor]
        for name, own in composed.items():
            *maps, last = by_name[name].through
            tiles[w][name] += own + max([tiles[w][last], *(one[called] for called in maps)])
    return StackBounds(
        {k.name: one[k.name] + NUMBER * _arguments(k) for k in kernels},
        {k.name: _reference(k, reference.bodies[k.name]) for k in kernels},
        tiles,
    )


def _arguments(kernel: Kernel) -> int:
    return len(kernel.inputs) + len(kernel.outputs)


def _reference(kernel: Kernel, body: str) -> int:
    summed = sum(a.size for a in kernel.outputs if a.summed)
    values = sum(line.count(",") + 1 for line in _DECLARED.findall(body))
    return FRAMES + NUMBER * (values + summed + 3 * _arguments(kernel))


def _tiles(kernel: Kernel, program: TileProgram, width: int) -> int:
    own = [a for a in kernel.inputs if not a.shared]
    rows = sum(a.size * (2 if a.summed else 1) for a in kernel.outputs)
    for argument in own:
        rows += argument.size * (3 * BLOCK if argument.name == program.turned else 1)
    values = sum(line.startswith("const vd") for line in program.body)
    called = _CALL.findall("\n".join(program.body))
    body = NUMBER * width * (values + sum(INLINED.get(name, 2) for name in called))
    prepare = NUMBER * len(program.prepare)
    fixed = ROW * rows + NUMBER * (program.uniform + 4 * _arguments(kernel))
    return FRAMES + fixed + max(body, prepare)


_DECLARED = re.compile(r"^  casadi_real (a\d.*);$", re.MULTILINE)
_CALL = re.compile(r"\bvd_(\w+)\(")
