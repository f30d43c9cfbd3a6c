"""Named, dense, row-major CasADi functions: what a C kernel takes, returns and means.

CasADi stores column-major and drops structural zeros; both are settled here and nowhere else:
every output of a `Kernel` is a dense vector in row-major order of its declared shape.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca

from symgen.errors import BuildError

Matrix = Any
"""`casadi.SX | casadi.DM`; CasADi ships no type stubs."""


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


class Instruction(NamedTuple):
    """One step of a CasADi function: its code, what it reads and writes.

    Of an input and an output one side is (argument, entry); all else are places that are used
    again. `constant` is 0 except for OP_CONST.
    """

    op: int
    reads: list[int]
    writes: list[int]
    constant: float


@dataclass(frozen=True)
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
        through: names of kernels that C calls one after the other instead: maps of the last input,
            then the kernel that takes their image for its own last input, and zeros for inputs
            that this one has not. Empty for all others.
    """

    name: str
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    equation: str
    per: str
    function: Any
    rare: bool = False
    factors: tuple[str, ...] = ()
    through: tuple[str, ...] = ()

    @cached_property
    def instructions(self) -> list[Instruction]:
        """The function step by step; to ask CasADi takes longer than to write C."""
        f, found = self.function, []
        for k in range(f.n_instructions()):
            op = f.instruction_id(k)
            constant = f.instruction_constant(k) if op == ca.OP_CONST else 0.0
            found.append(Instruction(op, f.instruction_input(k), f.instruction_output(k), constant))
        return found

    @cached_property
    def operations(self) -> int:
        """Arithmetic instructions of one evaluation; loads, stores and constants not counted."""
        idle = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        return sum(step.op not in idle for step in self.instructions)


def make_kernel(
    name: str,
    inputs: dict[Argument, Matrix],
    outputs: dict[Argument, Matrix],
    equation: str,
    per: str = "sample",
    rare: bool = False,
    factors: tuple[str, ...] = (),
    through: tuple[str, ...] = (),
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
        through: of a composition.

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
    given, made = tuple(inputs), tuple(outputs)
    return Kernel(name, given, made, equation, per, function, rare, factors, through)
