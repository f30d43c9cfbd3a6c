"""Every kernel in the forms that the templates write: for one sample, on tiles, as a product."""

from dataclasses import dataclass

from symgen.emit.product import Product, product, product_program
from symgen.emit.ssa import TileProgram, c_body, tile_program
from symgen.kernel import Kernel


@dataclass(frozen=True, slots=True)
class Forms:
    """By name of the kernel.

    Attributes:
        bodies: statements for one sample; none for a product.
        tiles: of all that are not rare.
        products: tables of those that are one.
    """

    bodies: dict[str, list[str]]
    tiles: dict[str, TileProgram]
    products: dict[str, Product]


def forms_of(kernels: tuple[Kernel, ...]) -> Forms:
    """Write each kernel once in every form.

    Raises:
        BuildError: an instruction has no C text.
    """
    by_name = {kernel.name: kernel for kernel in kernels}
    whole = [kernel for kernel in kernels if not kernel.factors]
    bodies = {kernel.name: c_body(kernel) for kernel in whole}
    tiles = {kernel.name: tile_program(kernel) for kernel in whole if not kernel.rare}
    products = {k.name: product(k, by_name, tiles) for k in kernels if k.factors}
    tiles |= {name: product_program(by_name[name], p, tiles) for name, p in products.items()}
    return Forms(bodies, tiles, products)
