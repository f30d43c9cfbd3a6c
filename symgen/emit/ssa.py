"""CasADi's instruction list → static single assignment C for W samples.

GCC's vector types hold W samples. Instructions that depend on shared inputs only, such as λ → π,
run once per batch on scalars (`prepare`), the others once per tile.

List scheduling keeps the processor's pipes full. CasADi writes expressions depth first, which keeps
few values alive. A recursion along a chain of bodies is then limited by latency, since a processor
looks ahead by less than one such body of code. Where the longest chain of dependent statements
takes more than half as long as issuing all of them, the statements are ordered by height instead,
as the scheduler of a compiler would.
"""

import re
from collections import Counter
from dataclasses import dataclass

import casadi as ca

from symgen.errors import BuildError
from symgen.kernel import Argument, Kernel

EXPRESSIONS = {  # CasADi operation → C expression for numbers
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
_TILE_EXPRESSIONS = {  # CasADi operation → C expression for vectors, with functions of lanes.h
    op: EXPRESSIONS[op]
    for op in (
        *(ca.OP_ASSIGN, ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV),
        *(ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE, ca.OP_INV),
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
_NEEDS_VECTORS = frozenset(  # operations whose shared operands must be broadcast to all lanes
    (ca.OP_ATAN2, ca.OP_FMIN, ca.OP_FMAX, ca.OP_IF_ELSE_ZERO, ca.OP_AND, ca.OP_OR)
)
LATENCY = 4  # cycles until a product or sum is available (current processors)
LONGER = {"vd_sincos(": 60, "vd_exp(": 60, "vd_sqrt(": 20, "1.0 / ": 13}
"""Cycles of statements that contain these texts; the functions are those of lanes.h."""
ISSUE = 2  # multiplications that start per cycle
ALIVE = 28  # live values above which a statement that frees registers goes first (AVX-512 has 32)


@dataclass(frozen=True, slots=True)
class Statement:
    """One line of C."""

    text: str  # the line
    defines: str  # name that it defines, "" for a store
    uses: tuple[str, ...]  # names that it uses


@dataclass(slots=True)
class _Node:
    """Statements that become one instruction: a sum, with the product that only the sum uses."""

    statements: list[Statement]
    needs: set[int]
    feeds: set[int]
    latency: int = LATENCY
    height: int = 0


@dataclass(frozen=True, slots=True)
class TileProgram:
    """A kernel split into statements per batch and statements per tile of samples."""

    prepare: list[str]  # statements that fill `u` from the shared inputs
    uniform: int  # length of `u`
    turned: str  # input whose sines and cosines the body reads from `sc`, else the first per sample
    turns: list[int]  # its entries, ascending; sine i is in row 2i of `sc`, cosine in 2i + 1
    body: list[str]  # statements on rows of W samples
    operations: int  # per sample, without those of `prepare`
    filled: dict[str, list[int]]  # output → entries that the body writes; others are always 0


def c_constant(value: float) -> str:
    """A double as C text: 17 significant digits, negative numbers in parentheses."""
    text = f"{value:.17g}"
    if not any(mark in text for mark in ".eni"):
        text += ".0"
    return f"({text})" if text.startswith("-") else text


def tile_program(kernel: Kernel) -> TileProgram:
    """The tile form of a kernel."""
    return _TileWriter(kernel).program()


class _TileWriter:
    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._prepare: list[str] = []
        self._body: list[Statement] = []
        self._slots: dict[str, int] = {}
        self._pairs: dict[str, str] = {}
        self._inverses: dict[str, str] = {}
        self._turned, self._turns = "", set[int]()
        self._operations = 0
        self._filled: dict[str, list[int]] = {a.name: [] for a in kernel.outputs}

    def program(self) -> TileProgram:
        kernel = self._kernel
        # Per place of CasADi's work vector: its C text, whether it is the same for all samples, and
        # its value where it is a constant. Places are reused, so each instruction overwrites them.
        text: dict[int, str] = {}
        shared: dict[int, bool] = {}
        constants: dict[int, float] = {}
        for k, step in enumerate(kernel.instructions):
            op, ins, outs, constant = step
            if op == ca.OP_INPUT:
                argument = kernel.inputs[ins[0]]
                shared[outs[0]] = argument.shared
                text[outs[0]] = f"{argument.name}[{ins[1]}{'' if argument.shared else ' * VS'}]"
                constants.pop(outs[0], None)
            elif op == ca.OP_CONST:
                constants[outs[0]] = constant
                text[outs[0]] = c_constant(constant)
                shared[outs[0]] = True
            elif op == ca.OP_OUTPUT:
                self._output(kernel.outputs[outs[0]], outs[1], text[ins[0]], shared[ins[0]])
            else:
                uniform = all(shared[i] for i in ins)  # then it runs once per batch
                operands = [text[i] for i in ins]
                if op == ca.OP_DIV and ins[1] in constants:
                    # a vector division takes ten times as long as a multiplication
                    op, operands[1] = ca.OP_MUL, c_constant(1.0 / constants[ins[1]])
                elif op == ca.OP_DIV and not uniform:
                    op, operands[1] = ca.OP_MUL, self._inverse(k, operands[1], shared[ins[1]])
                    operands[0] = self._operand(operands[0], shared[ins[0]], op)
                elif not uniform:
                    operands = [self._operand(text[i], shared[i], op) for i in ins]
                text[outs[0]] = self._statement(k, op, operands, uniform)
                shared[outs[0]] = uniform
                constants.pop(outs[0], None)
        return TileProgram(
            [*self._prepare, *(f"u[{slot}] = {name};" for name, slot in self._slots.items())],
            len(self._slots),
            self._turned or next(a.name for a in kernel.inputs if not a.shared),
            sorted(self._turns),
            [statement.text for statement in scheduled(self._body)],
            self._operations,
            self._filled,
        )

    def _output(self, argument: Argument, index: int, text: str, shared: bool) -> None:
        if shared and text == c_constant(0.0):
            return
        value = f"vd_all({self._text_in_tile(text)})" if shared else text
        self._filled[argument.name].append(index)
        line = f"{argument.name}[{index} * VS] {'+=' if argument.summed else '='} {value};"
        self._body.append(Statement(line, "", self._uses([value])))

    def _statement(self, k: int, op: int, operands: list[str], uniform: bool) -> str:
        name = f"t{k}"
        table = EXPRESSIONS if uniform else _TILE_EXPRESSIONS
        if not uniform:
            self._operations += 1
            if op in {ca.OP_SIN, ca.OP_COS}:
                return self._sine_or_cosine(op, operands[0], k)
        if op not in table:
            raise BuildError(
                f"kernel '{self._kernel.name}' uses the CasADi instruction {op} per sample, for "
                "which the emitter has no vector form; add it to symgen.emit.ssa"
            )
        line = table[op].format(*operands)
        if uniform:
            self._prepare.append(f"const double {name} = {line};")
        else:
            self._body.append(Statement(f"const vd {name} = {line};", name, self._uses(operands)))
        return name

    def _inverse(self, k: int, operand: str, shared: bool) -> str:
        """1 / operand, computed once for all quotients by it."""
        if operand not in self._inverses:
            name = self._inverses[operand] = f"inv{k}"
            if shared:
                self._prepare.append(f"const double {name} = 1.0 / {operand};")
            else:
                text = f"const vd {name} = 1.0 / {operand};"
                self._body.append(Statement(text, name, self._uses([operand])))
        return self._operand(self._inverses[operand], shared, ca.OP_MUL)

    def _sine_or_cosine(self, op: int, operand: str, k: int) -> str:
        """Sine and cosine together, which nearly all bodies need; those of an input from `sc`."""
        argument = _INPUT.fullmatch(operand)
        if argument and self._turned in {"", argument["name"]}:
            self._turned = argument["name"]
            self._turns.add(int(argument["index"]))
            return f"sc[{2 * int(argument['index']) + (op == ca.OP_COS)} * VS]"
        if operand not in self._pairs:
            self._pairs[operand] = f"sc{k}"
            text = f"vd sc{k}[2]; vd_sincos({operand}, sc{k}, sc{k} + 1);"
            self._body.append(Statement(text, f"sc{k}", self._uses([operand])))
        return f"{self._pairs[operand]}[{int(op == ca.OP_COS)}]"

    def _operand(self, text: str, shared: bool, op: int) -> str:
        if not shared:
            return text
        text = self._text_in_tile(text)
        return f"vd_all({text})" if op in _NEEDS_VECTORS else text

    def _text_in_tile(self, text: str) -> str:
        """Text of a shared value in a tile: inputs and constants directly, others from `u`."""
        if not _LOCAL.fullmatch(text):
            return text
        return f"u[{self._slots.setdefault(text, len(self._slots))}]"

    @staticmethod
    def _uses(operands: list[str]) -> tuple[str, ...]:
        """Names of the body among the operands; inputs and shared values are read from memory."""
        return tuple(dict.fromkeys(m[0] for o in operands if (m := _LOCAL.match(o))))


_INPUT = re.compile(r"(?P<name>\w+)\[(?P<index>\d+) \* VS\]")
_LOCAL = re.compile(r"(?:t|sc|inv)\d+\b")


def scheduled(statements: list[Statement]) -> list[Statement]:
    """Statements in an order that respects their dependences; short chains keep the given one."""
    nodes = _nodes(statements)
    for node in reversed(nodes):
        node.height = node.latency + max((nodes[k].height for k in node.feeds), default=0)
    if max((node.height for node in nodes), default=0) <= len(nodes) / ISSUE / 2:
        return statements
    return [statement for k in _by_height(nodes) for statement in nodes[k].statements]


def _nodes(statements: list[Statement]) -> list[_Node]:
    where = {s.defines: k for k, s in enumerate(statements) if s.defines}
    users = Counter(name for statement in statements for name in statement.uses)
    # A product that only one sum uses is fused with it (multiply-add): both become one node.
    owner = list(range(len(statements)))
    for k, statement in enumerate(statements):
        if not _SUM.fullmatch(statement.text):
            continue
        alone = [n for n in statement.uses if users[n] == 1]
        products = [n for n in alone if _PRODUCT.fullmatch(statements[where[n]].text)]
        if products:
            owner[where[products[-1]]] = k  # of two products a multiply-add takes one
    number = {k: i for i, k in enumerate(sorted(set(owner)))}
    nodes = [_Node([], set(), set()) for _ in number]
    for k, statement in enumerate(statements):
        node = nodes[number[owner[k]]]
        node.statements.append(statement)
        marks = (cycles for mark, cycles in LONGER.items() if mark in statement.text)
        node.latency = max(node.latency, next(marks, LATENCY))
    for k, statement in enumerate(statements):
        here = number[owner[k]]
        for name in statement.uses:
            there = number[owner[where[name]]]
            if there != here:
                nodes[here].needs.add(there)
                nodes[there].feeds.add(here)
    return nodes


def _by_height(nodes: list[_Node]) -> list[int]:
    """List scheduling on a model processor: the statement farthest from the end goes first."""
    waits = [len(node.needs) for node in nodes]
    unread = [len(node.feeds) for node in nodes]
    ready_at = [0] * len(nodes)
    # Change of the number of live values: its result, minus operands that it is the last to read.
    growth = [int(bool(node.feeds)) - sum(unread[m] == 1 for m in node.needs) for node in nodes]
    far = [(-node.height, k) for k, node in enumerate(nodes)]
    done = [False] * len(nodes)
    ready = {k for k, count in enumerate(waits) if count == 0}
    order: list[int] = []
    cycle = alive = 0
    while ready:  # one cycle per pass
        for _ in range(ISSUE):
            now = [k for k in ready if ready_at[k] <= cycle]
            if not now:
                break
            if alive < ALIVE:
                chosen = min(now, key=far.__getitem__)
            else:
                chosen = min(now, key=lambda k: (growth[k], far[k]))
                if growth[chosen] > 0 and any(growth[k] <= 0 for k in ready):
                    break  # wait: a statement that frees a register becomes ready
            ready.remove(chosen)
            done[chosen] = True
            order.append(chosen)
            alive += growth[chosen]
            for m in nodes[chosen].needs:  # the remaining reader of an operand will free it
                unread[m] -= 1
                if unread[m] == 1:
                    growth[next(k for k in nodes[m].feeds if not done[k])] -= 1
            for m in nodes[chosen].feeds:  # available once all operands have passed the pipe
                waits[m] -= 1
                ready_at[m] = max(ready_at[m], cycle + nodes[chosen].latency)
                if waits[m] == 0:
                    ready.add(m)
        cycle += 1
    return order


_SUM = re.compile(r"const vd \w+ = \S+ [+-] \S+;")
_PRODUCT = re.compile(r"const vd \w+ = \S+ \* \S+;")
