"""The forms of every kernel that the templates write: for one sample, on tiles, as a product."""

from dataclasses import dataclass

from symgen.emit.composition import composed_body, composed_program, compositions
from symgen.emit.product import Product, product, product_program
from symgen.emit.sample import c_body
from symgen.emit.ssa import TileProgram, tile_program
from symgen.kernel import Kernel


@dataclass(frozen=True, slots=True)
class Forms:
    """Forms by name of the kernel.

    Attributes:
        bodies: statements for one sample; products have none.
        tiles: tile forms of all kernels that are not rare.
        products: tables of all kernels that are products.
    """

    bodies: dict[str, list[str]]
    tiles: dict[str, TileProgram]
    products: dict[str, Product]


def forms_of(robot: str, kernels: tuple[Kernel, ...]) -> Forms:
    """Return all forms of the kernels.

    Args:
        robot: prefix of the functions' names.
        kernels: all kernels of the robot.

    Returns:
        Forms by name of the kernel.

    Raises:
        BuildError: an instruction has no C text.
    """
    by_name = {kernel.name: kernel for kernel in kernels}
    composed = compositions(by_name)
    called = {kernel.name for kernel in composed}
    whole = [kernel for kernel in kernels if not kernel.factors and kernel.name not in called]
    bodies = {kernel.name: c_body(kernel) for kernel in whole}
    bodies |= {k.name: composed_body(robot, k, by_name) for k in composed}
    factors = {name for kernel in kernels for name in kernel.factors}
    # Products need the structure of their factors, even of those without vector code.
    forms = {k.name: tile_program(k) for k in whole if not k.rare or k.name in factors}
    tiles = {name: form for name, form in forms.items() if not by_name[name].rare}
    for kernel in composed:  # may call a composition before it
        tiles[kernel.name] = composed_program(robot, kernel, by_name, tiles)
    products = {k.name: product(k, by_name, forms) for k in kernels if k.factors}
    vector = {name: p for name, p in products.items() if not by_name[name].rare}
    tiles |= {name: product_program(by_name[name], p, tiles) for name, p in vector.items()}
    return Forms(bodies, tiles, products)
