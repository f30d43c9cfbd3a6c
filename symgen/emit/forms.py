"""The forms of every kernel that the templates write: for one sample, on tiles, as a product.

A composition calls other kernels: τ(λ) = τ(β(π(λ))), h = τ(ddq = 0). Its last input goes through
maps; inputs that the kernel does not have are zero. Written out, it would repeat the text of the
kernel it calls, for the compiler to process at every level.

A product is a regressor times a block-diagonal Jacobian over the links, as tables for loops:
∂τ/∂λ = Y blockdiag(∂π/∂λ) has three times the operations of Y. Written out it was a fifth of all
compiled code, and slower: the compiler keeps neither Y nor the blocks in registers.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from symgen.emit.sample import c_body
from symgen.emit.ssa import TileProgram, tile_program
from symgen.kernel import Argument, Kernel, Kernels, KernelsByName


@dataclass(frozen=True, slots=True)
class Product:
    """Tables for the loops of `templates/`."""

    regressor: str  # regressor, block: kernels of the factors, the block its second output
    block: str
    joints: int  # joints, links, size: Y is joints × (links · size)
    links: int
    size: int
    entries: list[tuple[int, int]]  # (row, column) of the nonzeros of a block, column by column
    # joints whose rows of Y are not zero, link by link; first[k] to first[k + 1] belong to link k
    rows: list[int]
    first: list[int]  # start of each link in `rows`
    zeros: list[int]  # entries of Y in such rows that no statement writes


@dataclass(frozen=True, slots=True)
class Forms:
    """Forms by name of the kernel."""

    bodies: dict[str, list[str]]  # statements for one sample; products have none
    tiles: dict[str, TileProgram]  # tile forms of all kernels that are not rare
    products: dict[str, Product]  # tables of all kernels that are products


def forms_of(robot: str, kernels: Kernels) -> Forms:
    """All forms of the kernels; `robot` is the prefix of the functions' names."""
    by_name = {kernel.name: kernel for kernel in kernels}
    composed = compositions(by_name)
    called = {kernel.name for kernel in composed}
    whole = [kernel for kernel in kernels if not kernel.factors and kernel.name not in called]
    bodies = {kernel.name: c_body(kernel) for kernel in whole}
    bodies |= {k.name: composed_body(f"{robot}_", k, by_name) for k in composed}
    factors = {name for kernel in kernels for name in kernel.factors}
    # Products need the structure of their factors, even of those without vector code.
    forms = {k.name: tile_program(k) for k in whole if not k.rare or k.name in factors}
    tiles = {name: form for name, form in forms.items() if not by_name[name].rare}
    for kernel in composed:  # may call a composition before it
        tiles[kernel.name] = _composed_program(robot, kernel, by_name, tiles)
    products = {k.name: product(k, by_name, forms) for k in kernels if k.factors}
    vector = {name: p for name, p in products.items() if not by_name[name].rare}
    tiles |= {name: _product_program(by_name[name], p, tiles) for name, p in vector.items()}
    return Forms(bodies, tiles, products)


def product(kernel: Kernel, kernels: dict[str, Kernel], tiles: dict[str, TileProgram]) -> Product:
    """Tables of a kernel with `factors`."""
    left, right = kernel.factors
    (y,), jacobian = kernels[left].outputs, kernels[right].outputs[1]
    joints, width = y.shape
    size = jacobian.shape[0]
    links = width // size
    inside = set(tiles[right].filled[jacobian.name])
    filled = set(tiles[left].filled[y.name])
    rows, first, zeros = list[int](), [0], list[int]()
    for link in range(links):
        for joint in range(joints):
            at = joint * width + link * size
            block = set(range(at, at + size))
            if block & filled:
                rows.append(joint)
                zeros += sorted(block - filled)
        first.append(len(rows))
    entries = [(i, j) for j in range(size) for i in range(size) if i * size + j in inside]
    return Product(left, right, joints, links, size, entries, rows, first, zeros)


def _product_program(kernel: Kernel, p: Product, tiles: dict[str, TileProgram]) -> TileProgram:
    """Tile form of a product; the templates write its statements."""
    y = tiles[p.regressor]
    per_row = 2 * len(p.entries) - p.size
    entries = [
        (joint * p.links + link) * p.size + j
        for link in range(p.links)
        for joint in p.rows[p.first[link] : p.first[link + 1]]
        for j in range(p.size)
    ]
    operations = y.operations + len(p.rows) * per_row
    filled = {kernel.outputs[0].name: sorted(entries)}
    return TileProgram([], p.links * p.size**2, y.turned, y.turns, [], operations, filled)


def compositions(kernels: KernelsByName) -> list[Kernel]:
    """Kernels that are calls of others; one with a part that the catalogue lacks is none."""
    return [k for k in kernels.values() if is_composed(k, kernels)]


def is_composed(kernel: Kernel, kernels: KernelsByName) -> bool:
    """Whether a kernel is calls of others."""
    return bool(kernel.through) and kernels.keys() >= set(kernel.through)


def composed_body(prefix: str, kernel: Kernel, kernels: KernelsByName) -> list[str]:
    """C statements of a composition for one sample; a prefix of names is that of the robot."""
    *maps, last = (kernels[name] for name in kernel.through)
    image = last.inputs[-1] if maps else kernel.inputs[-1]
    words = [*_state(last), image.name, *(a.name for a in kernel.outputs)]
    return [
        *([f"double {image.name}[{image.size}];"] if maps else []),
        *(f"static const double {a.name}[{a.size}] = {{0}};" for a in _missing(kernel, last)),
        *_images(prefix, kernel, maps, image.name),
        f"{prefix}{last.name}({', '.join(words)});",
    ]


def _composed_program(
    robot: str, kernel: Kernel, kernels: KernelsByName, tiles: dict[str, TileProgram]
) -> TileProgram:
    """Tile form of a composition: `u` is the mapped value, then what the last kernel prepares."""
    *maps, last = (kernels[name] for name in kernel.through)
    inner, size = tiles[last.name], last.inputs[-1].size if maps else 0
    image, rest = ("u", f"u + {size}") if maps else (kernel.inputs[-1].name, "u")
    missing = {a.name: a.size for a in _missing(kernel, last)}
    state = [f"(const vu *){name}" if name in missing else name for name in _state(last)]
    words = ["sc", *state, image, rest, *(a.name for a in kernel.outputs)]
    outputs = zip(kernel.outputs, last.outputs, strict=True)
    return TileProgram(
        [
            *_images(f"{robot}_", kernel, maps, "u"),
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


def _images(prefix: str, kernel: Kernel, maps: list[Kernel], last: str) -> Iterator[str]:
    """Calls of the maps, one after the other; maps of one link are called link by link."""
    given = kernel.inputs[-1].name
    for one, count in _with_counts(kernel, maps):
        (source,), (result,) = one.inputs, one.outputs
        target = result.name
        if one is maps[-1]:
            target = last
        else:
            yield f"double {target}[{count * result.size}];"
        if count == 1:
            yield f"{prefix}{one.name}({given}, {target});"
        else:
            at, to = f"{given} + link * {source.size}", f"{target} + link * {result.size}"
            yield from [
                f"for (int link = 0; link < {count}; ++link) {{",
                f"    {prefix}{one.name}({at}, {to});",
                "}",
            ]
        given = target


def composed_numbers(kernel: Kernel, kernels: KernelsByName) -> int:
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
