"""A regressor times a block-diagonal Jacobian over the links, as tables for loops.

∂τ/∂λ = Y blockdiag(∂π/∂λ) has three times the operations of Y. Written out it was a fifth of all
compiled code, and slower: the compiler keeps neither Y nor the blocks in registers.
"""

from dataclasses import dataclass

from symgen.emit.ssa import TileProgram
from symgen.kernel import Kernel


@dataclass(frozen=True, slots=True)
class Product:
    """Tables for the loops of `templates/`.

    Attributes:
        regressor, block: kernels of the factors; the block is the second output of its kernel.
        joints, links, size: Y is joints × (links · size).
        entries: (row, column) of the structural nonzeros of a block, column by column.
        rows: joints whose rows of Y are not zero, link by link; first[k] to first[k + 1] belong to
            link k.
        first: start of each link in `rows`.
        zeros: entries of Y in such rows that no statement writes.
    """

    regressor: str
    block: str
    joints: int
    links: int
    size: int
    entries: list[tuple[int, int]]
    rows: list[int]
    first: list[int]
    zeros: list[int]


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


def product_program(kernel: Kernel, p: Product, tiles: dict[str, TileProgram]) -> TileProgram:
    """Tile form of a product; the templates write its statements."""
    y = tiles[p.regressor]
    per_row = 2 * len(p.entries) - p.size
    entries = [
        (joint * p.links + link) * p.size + j
        for link in range(p.links)
        for joint in p.rows[p.first[link] : p.first[link + 1]]
        for j in range(p.size)
    ]
    return TileProgram(
        [],
        p.links * p.size**2,
        y.turned,
        y.turns,
        [],
        y.operations + len(p.rows) * per_row,
        {kernel.outputs[0].name: sorted(entries)},
    )
