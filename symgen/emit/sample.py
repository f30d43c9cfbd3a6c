"""CasADi's instruction list → C for one sample."""

import casadi as ca

from symgen.emit.ssa import EXPRESSIONS, c_constant
from symgen.errors import BuildError
from symgen.kernel import Kernel

SHORT = 100
"""Characters of an expression that may stand where it is read."""


def c_body(kernel: Kernel) -> list[str]:
    """C statements of one kernel: constants, outputs by index.

    A value that is read once and has a short text stands where it is read, in parentheses; each of
    the others is one `const double`. A compiler takes a fifth less time than with a name for each.

    Raises:
        BuildError: an instruction has no C text.
    """
    reads = _reads(kernel)
    text: dict[int, str] = {}
    lines: list[str] = []
    for k, (op, inputs, outputs, constant) in enumerate(kernel.instructions):
        if op == ca.OP_INPUT:
            text[outputs[0]] = f"{kernel.inputs[inputs[0]].name}[{inputs[1]}]"
        elif op == ca.OP_CONST:
            text[outputs[0]] = c_constant(constant)
        elif op == ca.OP_OUTPUT:
            value = _bare(text[inputs[0]])
            lines.append(f"{kernel.outputs[outputs[0]].name}[{outputs[1]}] = {value};")
        elif op in EXPRESSIONS:
            value = EXPRESSIONS[op].format(*(text[i] for i in inputs))
            if reads[k] == 1 and len(value) <= SHORT:
                text[outputs[0]] = f"({value})"
            else:
                text[outputs[0]] = f"t{k}"
                lines.append(f"const double t{k} = {value};")
        else:
            raise BuildError(
                f"kernel '{kernel.name}' uses the CasADi instruction {op}, for which the emitter "
                "has no C text; add it to symgen.emit.ssa"
            )
    return lines


def _reads(kernel: Kernel) -> list[int]:
    """Number of places in the C text that read the result of each instruction."""
    reads = [0] * len(kernel.instructions)
    writer: dict[int, int] = {}  # place of the work vector → instruction; places are used again
    for k, step in enumerate(kernel.instructions):
        for place in step.reads if step.op not in {ca.OP_INPUT, ca.OP_CONST} else ():
            reads[writer[place]] += 2 if step.op in {ca.OP_SQ, ca.OP_TWICE} else 1
        if step.op != ca.OP_OUTPUT:
            writer[step.writes[0]] = k
    return reads


def _bare(value: str) -> str:
    """A value without the parentheses around all of it."""
    depth = 0
    for k, letter in enumerate(value):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:  # the first character already, unless it opens a parenthesis
            return value[1:-1] if k == len(value) - 1 and k > 0 else value
    return value
