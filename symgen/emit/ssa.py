"""CasADi's instruction list → static single assignment C, for one sample or for W of them.

The scalar form (`c_body`) is the reference: every instruction is one `const double`. The tile form
(`tile_program`) works on W samples at a time with GCC's vector types: what depends on shared
inputs only, such as λ → π, is computed once per batch as scalars (`prepare`), the rest per tile.
"""

from dataclasses import dataclass

import casadi as ca

from symgen.errors import BuildError
from symgen.kernel import Kernel

EXPRESSIONS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_FMIN: "fmin({0}, {1})",
    ca.OP_FMAX: "fmax({0}, {1})",
    ca.OP_LT: "(double)({0} < {1})",
    ca.OP_LE: "(double)({0} <= {1})",
    ca.OP_EQ: "(double)({0} == {1})",
    ca.OP_NE: "(double)({0} != {1})",
    ca.OP_NOT: "(double)({0} == 0.0)",
    ca.OP_AND: "(double)({0} != 0.0 && {1} != 0.0)",
    ca.OP_OR: "(double)({0} != 0.0 || {1} != 0.0)",
    ca.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}

_TILE_EXPRESSIONS = {
    op: EXPRESSIONS[op]
    for op in (
        ca.OP_ASSIGN,
        ca.OP_ADD,
        ca.OP_SUB,
        ca.OP_MUL,
        ca.OP_DIV,
        ca.OP_NEG,
        ca.OP_SQ,
        ca.OP_TWICE,
        ca.OP_INV,
    )
} | {
    ca.OP_SQRT: "vd_sqrt({0})",
    ca.OP_EXP: "vd_exp({0})",
    ca.OP_LOG: "vd_log({0})",
    ca.OP_TANH: "vd_tanh({0})",
    ca.OP_ATAN2: "vd_atan2({0}, {1})",
    ca.OP_FABS: "vd_abs({0})",
    ca.OP_FMIN: "vd_min({0}, {1})",
    ca.OP_FMAX: "vd_max({0}, {1})",
    ca.OP_LT: "vd_truth({0} < {1})",
    ca.OP_LE: "vd_truth({0} <= {1})",
    ca.OP_EQ: "vd_truth({0} == {1})",
    ca.OP_NE: "vd_truth({0} != {1})",
    ca.OP_NOT: "vd_truth({0} == 0.0)",
    ca.OP_AND: "vd_truth(({0} != 0.0) & ({1} != 0.0))",
    ca.OP_OR: "vd_truth(({0} != 0.0) | ({1} != 0.0))",
    ca.OP_IF_ELSE_ZERO: "vd_if({0}, {1})",
}
"""Arithmetic reads the same for a number and for a vector; the functions are those of lanes.h."""

_NEEDS_VECTORS = frozenset(
    (ca.OP_ATAN2, ca.OP_FMIN, ca.OP_FMAX, ca.OP_IF_ELSE_ZERO, ca.OP_AND, ca.OP_OR)
)
"""Operations whose shared operand must be spread over the lanes."""


@dataclass(frozen=True, slots=True)
class TileProgram:
    """A kernel split into what is computed once and what is computed per tile of W samples.

    Attributes:
        prepare: statements that fill `u` from the shared inputs.
        uniform: length of `u`.
        body: statements on rows of W samples.
        operations: per sample, without those of `prepare`.
    """

    prepare: list[str]
    uniform: int
    body: list[str]
    operations: int


def c_body(kernel: Kernel) -> list[str]:
    """Statements of one kernel: one constant per instruction, outputs by index.

    Raises:
        BuildError: an instruction has no C text yet.
    """
    f = kernel.function
    names: dict[int, str] = {}
    lines: list[str] = []
    for k in range(f.n_instructions()):
        op, inputs, outputs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
        if op == ca.OP_INPUT:
            names[outputs[0]] = f"{kernel.inputs[inputs[0]].name}[{inputs[1]}]"
        elif op == ca.OP_CONST:
            names[outputs[0]] = c_constant(f.instruction_constant(k))
        elif op == ca.OP_OUTPUT:
            lines.append(f"{kernel.outputs[outputs[0]].name}[{outputs[1]}] = {names[inputs[0]]};")
        elif op in EXPRESSIONS:
            text = EXPRESSIONS[op].format(*(names[i] for i in inputs))
            names[outputs[0]] = f"t{k}"
            lines.append(f"const double t{k} = {text};")
        else:
            raise BuildError(
                f"kernel '{kernel.name}' uses the CasADi instruction {op}, for which the emitter "
                "has no C text; add it to symgen.emit"
            )
    return lines


def c_constant(value: float) -> str:
    """17 significant digits, always a double, negative numbers in parentheses."""
    text = f"{value:.17g}"
    if not any(mark in text for mark in ".eni"):
        text += ".0"
    return f"({text})" if text.startswith("-") else text


def tile_program(kernel: Kernel) -> TileProgram:
    """The tile form of a kernel.

    Raises:
        BuildError: a per-sample instruction has no vector form.
    """
    return _TileWriter(kernel).program()


class _TileWriter:
    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._prepare: list[str] = []
        self._body: list[str] = []
        self._slots: dict[str, int] = {}
        self._pairs: dict[str, int] = {}
        self._operations = 0

    def program(self) -> TileProgram:
        f, kernel = self._kernel.function, self._kernel
        text: dict[int, str] = {}
        shared: dict[int, bool] = {}
        for k in range(f.n_instructions()):
            op, ins, outs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if op == ca.OP_INPUT:
                argument = kernel.inputs[ins[0]]
                text[outs[0]] = f"{argument.name}[{ins[1]}]"
                shared[outs[0]] = argument.shared
            elif op == ca.OP_CONST:
                text[outs[0]] = c_constant(f.instruction_constant(k))
                shared[outs[0]] = True
            elif op == ca.OP_OUTPUT:
                value = self._seen_by_tile(text[ins[0]]) if shared[ins[0]] else text[ins[0]]
                target = f"{kernel.outputs[outs[0]].name}[{outs[1]}]"
                self._body.append(f"{target} = {f'vd_all({value})' if shared[ins[0]] else value};")
            else:
                uniform = all(shared[i] for i in ins)
                operands = [text[i] for i in ins]
                if not uniform:
                    operands = [self._operand(text[i], shared[i], op) for i in ins]
                text[outs[0]] = self._statement(k, op, operands, uniform)
                shared[outs[0]] = uniform
        return TileProgram(self._prepare_lines(), len(self._slots), self._body, self._operations)

    def _statement(self, k: int, op: int, operands: list[str], uniform: bool) -> str:
        name = f"t{k}"
        table = EXPRESSIONS if uniform else _TILE_EXPRESSIONS
        if not uniform:
            self._operations += 1
        if not uniform and op in {ca.OP_SIN, ca.OP_COS}:
            return self._sine_or_cosine(op, operands[0], k)
        if op not in table:
            raise BuildError(
                f"kernel '{self._kernel.name}' uses the CasADi instruction {op} per sample, for "
                "which the emitter has no vector form; add it to symgen.emit.ssa"
            )
        kind, lines = ("double", self._prepare) if uniform else ("vd", self._body)
        lines.append(f"const {kind} {name} = {table[op].format(*operands)};")
        return name

    def _sine_or_cosine(self, op: int, operand: str, k: int) -> str:
        """Both at once, since the other one is nearly always needed too."""
        if operand not in self._pairs:
            self._pairs[operand] = k
            self._body.append(f"vd s{k}, c{k};")
            self._body.append(f"vd_sincos({operand}, &s{k}, &c{k});")
        return f"{'s' if op == ca.OP_SIN else 'c'}{self._pairs[operand]}"

    def _operand(self, text: str, shared: bool, op: int) -> str:
        if not shared:
            return text
        seen = self._seen_by_tile(text)
        return f"vd_all({seen})" if op in _NEEDS_VECTORS else seen

    def _seen_by_tile(self, text: str) -> str:
        """How the tile body reads a shared value: inputs and constants directly, others from u."""
        if not text.startswith("t") or "[" in text:
            return text
        return f"u[{self._slots.setdefault(text, len(self._slots))}]"

    def _prepare_lines(self) -> list[str]:
        return [*self._prepare, *(f"u[{slot}] = {name};" for name, slot in self._slots.items())]
