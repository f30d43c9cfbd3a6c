"""Named, dense, row-major CasADi functions: what a C kernel takes, returns and means.

CasADi stores column-major and drops structural zeros; both are settled here and nowhere else:
every output of a `Kernel` is a dense vector in row-major order of its declared shape.
"""

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symgen.errors import BuildError
from symgen.spatial import Matrix


@dataclass(frozen=True, slots=True)
class Argument:
    """One input or output: name, shape, unit.

    Attributes:
        shared: of an input only: one value usually serves all samples of a batch.
        summed: of an output only: a batch adds it up over its samples.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    summed: bool = False
    shared: bool = False

    @property
    def size(self) -> int:
        """Number of entries."""
        return math.prod(self.shape)

    def symbol(self) -> Matrix:
        """A fresh SX vector of this size."""
        return ca.SX.sym(self.name, self.size)


@dataclass(frozen=True, slots=True)
class Kernel:
    """One generated function.

    Attributes:
        per: "sample" when a batch runs over instants, "link" when it runs over bodies,
            "point" when it runs over anything else.
        equation: one line that says what is computed, with its source.
        function: dense and row-major, inputs and outputs in the declared order.
        rare: needed so seldom that a batch goes one by one, and vectors are not worth compiling.
        factors: names of a regressor and of a map's Jacobian, link by link, whose product this is:
            C multiplies what they return. Empty for all others.
    """

    name: str
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    equation: str
    per: str
    function: Any
    rare: bool = False
    factors: tuple[str, ...] = ()

    @property
    def operations(self) -> int:
        """Arithmetic instructions of one evaluation; loads, stores and constants not counted."""
        f = self.function
        idle = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        return sum(f.instruction_id(k) not in idle for k in range(f.n_instructions()))


def make_kernel(
    name: str,
    inputs: dict[Argument, Matrix],
    outputs: dict[Argument, Matrix],
    equation: str,
    per: str = "sample",
    rare: bool = False,
    factors: tuple[str, ...] = (),
) -> Kernel:
    """Freeze expressions into a kernel with common subexpressions shared.

    Args:
        name: C name of the kernel without the robot's prefix.
        inputs: argument → its symbol.
        outputs: argument → expression of its shape; vectors are columns.
        equation: what is computed.
        per: what a batch runs over.
        rare: no vector form.
        factors: of a product.

    Raises:
        BuildError: an expression does not have the declared shape.
    """
    rows = []
    for argument, expression in outputs.items():
        wanted = (*argument.shape, 1)[:2] if argument.shape else (1, 1)
        if tuple(expression.shape) != wanted:
            raise BuildError(
                f"kernel '{name}': output '{argument.name}' is declared {wanted}, "
                f"its expression is {tuple(expression.shape)}"
            )
        rows.append(ca.densify(ca.vec(ca.SX(expression).T)))
    function = ca.Function(
        name,
        list(inputs.values()),
        rows,
        [a.name for a in inputs],
        [a.name for a in outputs],
        {"cse": True},
    )
    return Kernel(name, tuple(inputs), tuple(outputs), equation, per, function, rare, factors)
