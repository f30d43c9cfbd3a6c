"""Kernels that call other kernels: τ(λ) = τ(β(π(λ))), h = τ(ddq = 0).

The last input goes through maps; inputs that the kernel does not have are zero. Written out, such a
kernel would repeat the text of the one it calls, for the compiler to process at every level.
"""

from collections.abc import Iterator

from symgen.emit.ssa import TileProgram
from symgen.kernel import Argument, Kernel

Kernels = dict[str, Kernel]


def compositions(kernels: Kernels) -> list[Kernel]:
    """Return the kernels that are calls of other kernels.

    A kernel whose parts are not all in the catalogue is written out instead, and is not returned.
    """
    return [k for k in kernels.values() if k.through and kernels.keys() >= set(k.through)]


def composed_body(robot: str, kernel: Kernel, kernels: Kernels) -> list[str]:
    """C statements of a composition for one sample."""
    *maps, last = (kernels[name] for name in kernel.through)
    image = last.inputs[-1] if maps else kernel.inputs[-1]
    words = [*_state(last), image.name, *(a.name for a in kernel.outputs)]
    return [
        *([f"double {image.name}[{image.size}];"] if maps else []),
        *(f"static const double {a.name}[{a.size}] = {{0}};" for a in _missing(kernel, last)),
        *_images(robot, kernel, maps, image.name),
        f"{robot}_{last.name}({', '.join(words)});",
    ]


def composed_program(
    robot: str, kernel: Kernel, kernels: Kernels, tiles: dict[str, TileProgram]
) -> TileProgram:
    """Tile form of a composition; the maps are computed once per batch.

    `u` holds the mapped value, followed by what the last kernel prepares.
    """
    *maps, last = (kernels[name] for name in kernel.through)
    inner, size = tiles[last.name], last.inputs[-1].size if maps else 0
    image, rest = ("u", f"u + {size}") if maps else (kernel.inputs[-1].name, "u")
    missing = {a.name: a.size for a in _missing(kernel, last)}
    state = [f"(const vu *){name}" if name in missing else name for name in _state(last)]
    words = ["sc", *state, image, rest, *(a.name for a in kernel.outputs)]
    outputs = zip(kernel.outputs, last.outputs, strict=True)
    return TileProgram(
        [
            *_images(robot, kernel, maps, "u"),
            f"{robot}_{last.name}_prepare({image}, {rest});",
        ],
        size + inner.uniform,
        inner.turned,
        inner.turns,
        [
            *(f"static const double {name}[{n} * LANES] = {{0}};" for name, n in missing.items()),
            f"{last.name}_lanes({', '.join(words)});",
        ],
        inner.operations,
        {ours.name: inner.filled[theirs.name] for ours, theirs in outputs},
    )


def _state(last: Kernel) -> list[str]:
    return [a.name for a in last.inputs[:-1]]


def _missing(kernel: Kernel, last: Kernel) -> list[Argument]:
    available = {a.name for a in kernel.inputs}
    return [a for a in last.inputs[:-1] if a.name not in available]


def _images(robot: str, kernel: Kernel, maps: list[Kernel], last: str) -> list[str]:
    """Calls of the maps, one after the other; maps of one link are called link by link."""
    lines = list[str]()
    given = kernel.inputs[-1].name
    for one, count in _with_counts(kernel, maps):
        (source,), (result,) = one.inputs, one.outputs
        target = result.name
        if one is maps[-1]:
            target = last
        else:
            lines.append(f"double {target}[{count * result.size}];")
        if count == 1:
            lines.append(f"{robot}_{one.name}({given}, {target});")
        else:
            at, to = f"{given} + link * {source.size}", f"{target} + link * {result.size}"
            lines += [
                f"for (int link = 0; link < {count}; ++link) {{",
                f"    {robot}_{one.name}({at}, {to});",
                "}",
            ]
        given = target
    return lines


def composed_numbers(kernel: Kernel, kernels: Kernels) -> int:
    """Numbers that the calls keep on the stack at most: all mapped values."""
    maps = [kernels[name] for name in kernel.through[:-1]]
    return sum(count * one.outputs[0].size for one, count in _with_counts(kernel, maps))


def _with_counts(kernel: Kernel, maps: list[Kernel]) -> Iterator[tuple[Kernel, int]]:
    """Each map and the number of its calls: one per block of the value before it."""
    length = kernel.inputs[-1].size
    for one in maps:
        count = length // one.inputs[0].size
        length = count * one.outputs[0].size
        yield one, count
