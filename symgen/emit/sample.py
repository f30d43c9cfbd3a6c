"""CasADi's instruction list → C for one sample; long bodies in parts; CasADi's own C code.

Long straight-line bodies become several functions, so that compiling them takes linear time. The
statements keep their order. A value that a later part needs is stored in `w`, whose places are used
again once the last part that needs a value has passed.

C code by CasADi is the reference for all other forms. The functions that `casadi.CodeGenerator`
writes are kept verbatim. Its entry points, sparsity tables and macros are left out: they would
export names that other robots export as well.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from symgen.emit.ssa import EXPRESSIONS, c_constant
from symgen.errors import BuildError
from symgen.kernel import Kernel, Kernels

SHORT = 100  # characters of an expression that may stand where it is read
LONG = 2400  # statements above which a body is split; arms of seven joints stay whole
PART = 600  # statements of a part: compilers take about as long per statement as in short functions


@dataclass(frozen=True)
class Numbers:
    """How a body spells its numbers."""

    type: str = "double"  # type of values and constants
    literal: str = "{}"  # text of a constant, `{}` in the place of its digits
    suffix: str = ""  # what functions of <math.h> end in
    turn: str = ""  # function that stores sine and cosine of its first argument; "" for two calls

    @cached_property
    def expressions(self) -> dict[int, str]:
        """CasADi operation → expression in these numbers."""
        texts = {}
        for op, text in EXPRESSIONS.items():
            of_type = text.replace("(double)", f"({self.type})")
            named = _FUNCTION.sub(rf"\g<0>{self.suffix}", of_type)
            texts[op] = _DIGITS.sub(lambda digits: self.literal.format(digits[0]), named)
        return texts

    def constant(self, value: float) -> str:
        """Text of a constant, negative ones in parentheses."""
        text = self.literal.format(c_constant(value).strip("()"))
        return f"({text})" if text.startswith("-") else text


_FUNCTION = re.compile(r"\b[a-z]\w*(?=\()")
_DIGITS = re.compile(r"\b\d\.\d\b")
DOUBLE = Numbers()


@dataclass(frozen=True, slots=True)
class ReferenceCode:
    """Text by CasADi."""

    helpers: str  # static functions that the bodies call
    bodies: dict[str, str]  # kernel → its static function, in the order of the file
    functions: dict[str, str]  # kernel → name of its function


@dataclass(frozen=True, slots=True)
class Parts:
    """A split body."""

    bodies: list[list[str]]  # statements of the parts, in the order of their calls
    stored: int  # length of `w`


def c_body(kernel: Kernel, numbers: Numbers = DOUBLE) -> list[str]:
    """C statements of one kernel: constants, outputs by index.

    A short value that is read once stands where it is read: a compiler takes a fifth less time.
    """
    reads = _reads(kernel)
    text: dict[int, str] = {}
    lines: list[str] = []
    turned = dict[str, int]()  # angle → instruction of its sine or cosine
    for k, (op, inputs, outputs, constant) in enumerate(kernel.instructions):
        if op == ca.OP_INPUT:
            text[outputs[0]] = f"{kernel.inputs[inputs[0]].name}[{inputs[1]}]"
        elif op == ca.OP_CONST:
            text[outputs[0]] = numbers.constant(constant)
        elif op == ca.OP_OUTPUT:
            value = _bare(text[inputs[0]])
            lines.append(f"{kernel.outputs[outputs[0]].name}[{outputs[1]}] = {value};")
        elif numbers.turn and op in {ca.OP_SIN, ca.OP_COS}:
            angle = text[inputs[0]]
            if angle not in turned:
                turned[angle] = k
                lines.append(f"{numbers.type} s{k}, c{k};")
                lines.append(f"{numbers.turn}({_bare(angle)}, s{k}, c{k});")
            text[outputs[0]] = f"{'s' if op == ca.OP_SIN else 'c'}{turned[angle]}"
        elif op in EXPRESSIONS:
            value = numbers.expressions[op].format(*(text[i] for i in inputs))
            if reads[k] == 1 and len(value) <= SHORT:
                text[outputs[0]] = f"({value})"
            else:
                text[outputs[0]] = f"t{k}"
                lines.append(f"const {numbers.type} t{k} = {value};")
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
        if step.op not in _SOURCES:
            for place in step.reads:
                reads[writer[place]] += 2 if step.op in _READ_TWICE else 1
        if step.op != ca.OP_OUTPUT:
            writer[step.writes[0]] = k
    return reads


_SOURCES = frozenset((ca.OP_INPUT, ca.OP_CONST))
_READ_TWICE = frozenset((ca.OP_SQ, ca.OP_TWICE))


def _bare(value: str) -> str:
    """A value without the parentheses around all of it."""
    depth = 0
    for k, letter in enumerate(value):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:  # the first character already, unless it opens a parenthesis
            return value[1:-1] if k == len(value) - 1 and k > 0 else value
    return value


def parts_of(lines: Sequence[str], size: int = PART) -> Parts:
    """Split statements `const double tK = …;` and `output[i] = …;`."""
    chunks = [list(lines[k : k + size]) for k in range(0, len(lines), size)]
    defined: dict[str, int] = {}
    last: dict[str, int] = {}
    for k, chunk in enumerate(chunks):
        for line in chunk:
            target = _DEFINED.match(line)
            for name in _VALUE.findall(line[target.end() :] if target else line):
                last[name] = k
            if target:
                defined[target[1]] = k
    places: dict[str, int] = {}
    free: list[int] = []
    stored = 0
    bodies = []
    for k, chunk in enumerate(chunks):
        stored_at = dict(places)

        def placed(match: re.Match[str], stored_at: dict[str, int] = stored_at) -> str:
            name = match[0]
            return f"w[{stored_at[name]}]" if name in stored_at else name

        body = []
        for line in chunk:
            body.append(_VALUE.sub(placed, line))
            target = _DEFINED.match(line)
            if target and last.get(target[1], k) > k:
                if not free:
                    free, stored = [stored], stored + 1
                places[target[1]] = free.pop()
                body.append(f"w[{places[target[1]]}] = {target[1]};")
        bodies.append(body)
        for name in [name for name in places if last[name] <= k]:
            free.append(places.pop(name))
    return Parts(bodies, stored)


_DEFINED = re.compile(r"const double (t\d+) = ")
_VALUE = re.compile(r"\bt\d+\b")


def reference_code(kernels: Kernels) -> ReferenceCode:
    """Return CasADi's C code of the kernels."""
    generator = ca.CodeGenerator("reference", {"casadi_int": "long"})
    for kernel in kernels:
        generator.add(kernel.function)
    text = generator.dump()
    _, visibility, rest = text.partition(_BEFORE_HELPERS)
    helpers, configuration, rest = rest.partition(_AFTER_HELPERS)
    bodies, functions = {}, {}
    for match in _HEAD.finditer(rest):
        end = rest.index("\n}\n", match.end()) + len("\n}\n")
        bodies[match["name"]] = rest[match.start("definition") : end]
        functions[match["name"]] = match["function"]
    if not visibility or not configuration or list(bodies) != [k.name for k in kernels]:
        raise BuildError(
            f"the C code of CasADi {ca.CasadiMeta.version()} is laid out differently from what "
            "symgen.emit.sample reads; install the version that pyproject.toml names"
        )
    return ReferenceCode(_DEFINITION.sub(r"static \g<0>", helpers).strip(), bodies, functions)


_BEFORE_HELPERS = "    #define CASADI_SYMBOL_EXPORT\n  #endif\n#endif\n"
_AFTER_HELPERS = "/* Configuration this file was compiled with */"
_HEAD = re.compile(
    r"^/\* (?P<name>\w+):\(.*\n(?P<definition>static int (?P<function>casadi_f\d+)\()", re.MULTILINE
)
_DEFINITION = re.compile(r"^casadi_real (?=casadi_\w+\()", re.MULTILINE)
