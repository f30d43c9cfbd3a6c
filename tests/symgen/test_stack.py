"""Bounds for the stack of compositions and products, added up by hand."""

from types import SimpleNamespace

import casadi as ca

from symgen.emit.files import FRAMES, stack_bounds
from symgen.emit.forms import composed_numbers
from symgen.emit.programs import _example
from symgen.emit.ssa import tile_program
from symgen.kernel import Argument, Kernel, make_kernel


def kernel(
    name: str, size: int, result: int, through: tuple[str, ...] = (), rare: bool = False
) -> Kernel:
    """A kernel of one input of so many numbers."""
    x = ca.SX.sym("x", size)
    row = ca.repmat(ca.sum1(x), result, 1)
    argument = {Argument(f"x_{name}", (size,), "1"): x}
    return make_kernel(
        name, argument, {Argument("y", (result,), "1"): row}, "", rare=rare, through=through
    )


def test_calls_and_factors_are_added_up() -> None:
    """Oracle: statements, mapped values, arguments and the deepest call, 8 bytes each, by hand.

    `all` calls `double` for each 2 of its 8 numbers, `halve` for each 3 of the 12 results, and
    `sum` on the 4 that are left: 12 and 4 numbers are on the stack beside the longest called body.
    """
    kernels = (
        kernel("double", 2, 3),
        kernel("halve", 3, 1),
        kernel("sum", 4, 1),
        kernel("all", 8, 1, ("double", "halve", "sum")),
        kernel("product", 5, 1, rare=True),
    )
    lines = {"double": 7, "halve": 20, "sum": 3, "all": 1}
    forms = SimpleNamespace(
        bodies={name: [""] * count for name, count in lines.items()},
        products={
            "product": SimpleNamespace(joints=2, links=3, size=10, regressor="sum", block="double")
        },
        tiles={k.name: tile_program(k) for k in kernels if not k.rare},
    )
    assert composed_numbers(kernels[3], {k.name: k for k in kernels}) == 12 + 4
    bounds = stack_bounds(kernels, forms, SimpleNamespace(bodies={})).one
    arguments = 2  # an input and an output
    assert bounds["double"] == FRAMES + 8 * (7 + arguments)
    assert bounds["all"] == FRAMES + 8 * (1 + 12 + 4 + arguments) + FRAMES + 8 * 20
    factors = 2 * 3 * 10 + 10 + 10 * 10
    assert bounds["product"] == FRAMES + 8 * (factors + arguments) + FRAMES + 8 * 7


def test_the_example_names_a_position_per_joint() -> None:
    """Property: a base on the ground has no coordinates, a free one six zeros before the joints."""
    facts = {"joints": ["a", "b"], "pi0": [1.0] * 20, "home": [0.1, 0.2]}
    assert _example(facts)["home"] == [0.1, 0.2]
    assert _example(facts | {"floating": True})["home"] == [0.0] * 6 + [0.1, 0.2]


def test_a_product_holds_the_regressor_of_its_links() -> None:
    """Oracle: a row of 64 bytes for each joint, link and parameter, here of two more links."""
    kernels = (kernel("rows", 2, 1), kernel("block", 2, 1), kernel("product", 5, 1))
    bodies = {"rows": [""], "block": [""]}
    tiles = {k.name: tile_program(k) for k in kernels}
    depth = []
    for links in (3, 5):
        made = SimpleNamespace(joints=2, links=links, size=10, regressor="rows", block="block")
        forms = SimpleNamespace(bodies=bodies, products={"product": made}, tiles=tiles)
        depth.append(stack_bounds(kernels, forms, SimpleNamespace(bodies={})).tiles)
    for width, bounds in depth[0].items():
        assert depth[1][width]["product"] - bounds["product"] == 64 * 2 * 2 * 10
        assert bounds["product"] > bounds["rows"] + 64 * 2 * 3 * 10
