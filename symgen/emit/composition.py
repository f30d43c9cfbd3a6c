"""A kernel that is another one at other arguments, as calls: τ(λ) = τ(β(π(λ))), h = τ(ddq = 0).

Its last input goes through maps, inputs that it does not have are zero. Written out, it would be
the text of the kernel it calls once more, for the compiler to work through at every level.
"""

from collections.abc import Iterator

from symgen.emit.ssa import TileProgram
from symgen.kernel import Argument, Kernel

Kernels = dict[str, Kernel]


def compositions(kernels: Kernels) -> list[Kernel]:
    """Kernels that are calls; where one that they call is missing, they are written out."""
    return [k for k in kernels.values() if k.through and kernels.keys() >= set(k.through)]


def composed_body(robot: str, kernel: Kernel, kernels: Kernels) -> list[str]:
    """Statements for one sample."""
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
    """The maps are computed once per batch: `u` is the image, then what the last prepares."""
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
        {own.name: inner.filled[theirs.name] for own, theirs in outputs},
    )


def _state(last: Kernel) -> list[str]:
    return [a.name for a in last.inputs[:-1]]


def _missing(kernel: Kernel, last: Kernel) -> list[Argument]:
    own = {a.name for a in kernel.inputs}
    return [a for a in last.inputs[:-1] if a.name not in own]


def _images(robot: str, kernel: Kernel, maps: list[Kernel], last: str) -> list[str]:
    """Calls of the maps, one after the other, link by link where they are of one link."""
    lines = list[str]()
    given = kernel.inputs[-1].name
    for one, count in _with_counts(kernel, maps):
        (own,), (made,) = one.inputs, one.outputs
        target = made.name
        if one is maps[-1]:
            target = last
        else:
            lines.append(f"double {target}[{count * made.size}];")
        if count == 1:
            lines.append(f"{robot}_{one.name}({given}, {target});")
        else:
            at, to = f"{given} + link * {own.size}", f"{target} + link * {made.size}"
            lines += [
                f"for (int link = 0; link < {count}; ++link) {{",
                f"    {robot}_{one.name}({at}, {to});",
                "}",
            ]
        given = target
    return lines


def composed_numbers(kernel: Kernel, kernels: Kernels) -> int:
    """Numbers that the calls keep on the stack at most: every image."""
    maps = [kernels[name] for name in kernel.through[:-1]]
    return sum(count * one.outputs[0].size for one, count in _with_counts(kernel, maps))


def _with_counts(kernel: Kernel, maps: list[Kernel]) -> Iterator[tuple[Kernel, int]]:
    """Each map and how often it is called: once per piece of what the one before has made."""
    length = kernel.inputs[-1].size
    for one in maps:
        count = length // one.inputs[0].size
        length = count * one.outputs[0].size
        yield one, count
