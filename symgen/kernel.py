"""Named, dense, row-major CasADi functions: the inputs, outputs and meaning of a C kernel.

CasADi stores matrices column by column and drops structural zeros. `make_kernel` is the only place
that converts: every output of a `Kernel` is a dense vector in row-major order of its shape.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symgen.errors import BuildError

FURTHER = "further"  # name of the argument of all symbols that are not inputs

Array = NDArray[np.float64]
Matrix = Any  # `casadi.SX | casadi.DM`; CasADi ships no type stubs


@dataclass(frozen=True, slots=True)
class Argument:
    """One input or output of a kernel: name, shape, unit."""

    name: str  # C name of the argument
    shape: tuple[int, ...]  # dimensions; the array is dense and row-major
    unit: str  # such as "rad/s" or "rad|m", revolute and prismatic joints
    summed: bool = False  # True for an output that a batch adds up over its samples
    shared: bool = False  # True for an input whose one value usually serves all samples of a batch

    @property
    def size(self) -> int:
        """Number of entries."""
        return math.prod(self.shape)

    def symbol(self) -> Matrix:
        """A new SX vector of this size."""
        return ca.SX.sym(self.name, self.size)


class Instruction(NamedTuple):
    """One instruction of a CasADi function."""

    op: int  # CasADi operation code
    reads: list[int]  # work-vector indices of the operands; of an input (argument, entry)
    writes: list[int]  # work-vector indices of the results; of an output (argument, entry)
    constant: float  # value for OP_CONST, else 0


@dataclass(frozen=True)
class Kernel:
    """One generated function."""

    name: str  # C name without the prefix of the robot
    inputs: tuple[Argument, ...]  # arguments in the order of the C function
    outputs: tuple[Argument, ...]  # results in the order of the C function
    equation: str  # one line that states what is computed, with its source
    per: str  # "sample" if a batch runs over time samples, "link" over bodies, else "point"
    function: Any  # dense, row-major, in the declared order, then `FURTHER` (`with_further`)
    # True for kernels that are called seldom: a batch calls them sample by sample, and no vector
    # code is compiled
    rare: bool = False
    # names of a regressor kernel and of a Jacobian kernel of a map of link parameters. The kernel
    # is their product, link by link, and its C code multiplies their results. Else empty
    factors: tuple[str, ...] = ()
    # names of kernels that the C code calls one after the other: maps of the last input, then a
    # kernel that takes the mapped value as its last input. Inputs that this kernel does not have
    # are passed as zeros. Else empty
    through: tuple[str, ...] = ()
    # True where no loop over samples calls the function of one sample, in kernels.c; `symgen build`
    # compiles it without optimisation, in a fifth of the time. It takes some 2 µs longer
    unhurried: bool = False

    @cached_property
    def instructions(self) -> list[Instruction]:
        """Instructions of the function. Cached, since reading them from CasADi is slow."""
        f, steps = self.function, []
        for k in range(f.n_instructions()):
            op = f.instruction_id(k)
            constant = f.instruction_constant(k) if op == ca.OP_CONST else 0.0
            steps.append(Instruction(op, f.instruction_input(k), f.instruction_output(k), constant))
        return steps

    @cached_property
    def operations(self) -> int:
        """Arithmetic instructions of one evaluation, without loads, stores and constants."""
        idle = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        return sum(step.op not in idle for step in self.instructions)


Kernels = tuple[Kernel, ...]  # in the order of the generated files
KernelsByName = dict[str, Kernel]


def make_kernel(
    name: str,
    inputs: dict[Argument, Matrix],
    outputs: dict[Argument, Matrix],
    equation: str,
    per: str = "sample",
    rare: bool = False,
    factors: tuple[str, ...] = (),
    through: tuple[str, ...] = (),
    unhurried: bool = False,
) -> Kernel:
    """Return a kernel of symbolic expressions, with common subexpressions shared."""
    rows = []
    for argument, expression in outputs.items():
        declared = (*argument.shape, 1)[:2] if argument.shape else (1, 1)
        if tuple(expression.shape) != declared:
            raise BuildError(
                f"kernel '{name}': output '{argument.name}' is declared {declared}, "
                f"its expression is {tuple(expression.shape)}"
            )
        # Transposed, because CasADi's vec goes column by column and C arrays are row-major.
        rows.append(ca.densify(ca.vec(ca.SX(expression).T)))
    names, options = [a.name for a in outputs], {"cse": True, "allow_free": True}
    entries = [a.name for a in inputs]
    function = ca.Function(name, list(inputs.values()), rows, entries, names, options)
    if function.has_free():
        symbols = [*inputs.values(), ca.vertcat(*function.free_sx())]
        function = ca.Function(name, symbols, rows, [*entries, FURTHER], names, {"cse": True})
    given, computed = tuple(inputs), tuple(outputs)
    return Kernel(name, given, computed, equation, per, function, rare, factors, through, unhurried)


make_rare = partial(make_kernel, rare=True)
make_slow = partial(make_kernel, rare=True, unhurried=True)


def with_further(kernel: Kernel, values: Callable[[dict[str, Matrix], Matrix], Matrix]) -> Kernel:
    """The kernel with values in place of the symbols that are not inputs."""
    function = kernel.function
    if function.n_in() == len(kernel.inputs):
        return kernel
    *inputs, further = function.sx_in()
    rows = function.call([*inputs, further])
    names = [a.name for a in kernel.inputs]
    rows = ca.substitute(rows, [further], [values(dict(zip(names, inputs, strict=True)), further)])
    outputs = [a.name for a in kernel.outputs]
    complete = ca.Function(kernel.name, inputs, rows, names, outputs, {"cse": True})
    return replace(kernel, function=complete)
