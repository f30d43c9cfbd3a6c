"""Mutants of Python by its syntax tree and of templates of C by their text.

A mutant is one replaced piece of one line: a sign, a constant (ten times as large; a large integer
a tenth, a small one the next), a comparison, a minimum made a maximum, a condition negated.
Docstrings, annotations and messages of errors stay.
"""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_BINARY = {ast.Add: (b"+", b"-"), ast.Sub: (b"-", b"+"), ast.Mult: (b"*", b"/")}
_BINARY |= {ast.Div: (b"/", b"*")}
_COMPARED = {ast.Lt: (b"<", b">="), ast.LtE: (b"<=", b"<"), ast.Gt: (b">", b"<=")}
_COMPARED |= {ast.GtE: (b">=", b">"), ast.Eq: (b"==", b"!="), ast.NotEq: (b"!=", b"==")}
_NAMES = {"min": "max", "minimum": "maximum", "argmin": "argmax", "fmin": "fmax"}
_NAMES |= {"any": "all", "zeros": "ones", "floor": "ceil", "sin": "cos"}
_NAMES |= {new: old for old, new in _NAMES.items()}
_C = re.compile(
    r"fmin|fmax|&&|\|\||(?<= )(?:<=|>=|[<>*/+-])(?= )"
    r"|\b\d+\.\d*(?:e[-+]?\d+)?\b|\b\de-?\d+\b"
)
_C_TEXT = {"fmin": "fmax", "fmax": "fmin", "&&": "||", "||": "&&", "<": "<=", ">": ">="}
_C_TEXT |= {"<=": "<", ">=": ">", "*": "/", "/": "*", "+": "-", "-": "+"}
_C_IDLE = re.compile(r"/\*.*?\*/|\{[%#{].*?[%#}]\}|^\s*#.*?$|\"[^\"\n]*\"", re.S | re.M)


LARGE = 10
"""Integers from here on are sizes and limits, smaller ones places, axes and exponents."""

GUARD = 1e-100
"""Smaller numbers keep a divisor from 0; ten times as much keeps it from 0 as well."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One altered file.

    Attributes:
        path: of the file, from the root of the repository.
        line: number of the line, from 1.
        before, after: the line as it is and as altered, without indentation.
        whole: the file as it is.
        text: the altered file.
    """

    path: str
    line: int
    before: str
    after: str
    whole: str
    text: str


def mutants_of(file: Path, root: Path) -> list[Mutant]:
    """Return every mutant of a file.

    Args:
        file: Python, or a template of C.
        root: of the repository.

    Returns:
        Mutants in the order of the file.
    """
    data = file.read_bytes()
    pieces = _python(data) if file.suffix == ".py" else _template(data.decode())
    found = []
    for first, last, new in sorted(pieces):
        changed = data[:first] + new + data[last:]
        number = data.count(b"\n", 0, first)
        before, after = (t.splitlines()[number].decode().strip() for t in (data, changed))
        name = file.relative_to(root).as_posix()
        found.append(Mutant(name, number + 1, before, after, data.decode(), changed.decode()))
    return found


Piece = tuple[int, int, bytes]
"""First byte, one past the last byte, and what replaces them."""


def _template(text: str) -> Iterator[Piece]:
    idle = [match.span() for match in _C_IDLE.finditer(text)]
    for match in _C.finditer(text):
        first = match.start()
        if any(a <= first < b for a, b in idle):
            continue
        new = _C_TEXT.get(match[0]) or (f"({match[0]} * 10)" if float(match[0]) else "1.0")
        start = len(text[:first].encode())
        yield start, start + len(match[0].encode()), new.encode()


def _python(data: bytes) -> Iterator[Piece]:
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def span(node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None  # noqa: S101 - for mypy: parsed nodes have an end
        assert node.end_col_offset is not None  # noqa: S101
        end = starts[node.end_lineno - 1] + node.end_col_offset
        return starts[node.lineno - 1] + node.col_offset, end

    def between(left: ast.expr, right: ast.expr, old: bytes, new: bytes) -> Iterator[Piece]:
        first, last = span(left)[1], span(right)[0]
        at = data.find(old, first, last)
        if at >= 0:
            yield at, at + len(old), new

    for node in _alive(ast.parse(data)):
        match node:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                yield from between(left, right, *_BINARY[type(op)])
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARED:
                yield from between(left, right, *_COMPARED[type(op)])
            case ast.BoolOp(op=op, values=values):
                words = (b"and", b"or") if isinstance(op, ast.And) else (b"or", b"and")
                yield from between(values[0], values[1], *words)
            case ast.UnaryOp(op=ast.USub() | ast.Not() as op):
                first = span(node)[0]
                yield first, first + (1 if isinstance(op, ast.USub) else len(b"not")), b" "
            case ast.IfExp(test=test) | ast.If(test=test):
                first, last = span(test)
                yield first, last, b"not (" + data[first:last] + b")"
            case ast.Constant(value=bool(value)):
                yield *span(node), str(not value).encode()
            case ast.Constant(value=int() | float() as value) if not 0 < value < GUARD:
                new = _constant(value)
                yield *span(node), repr(new).encode()
            case ast.Attribute(attr=name) if name in _NAMES:
                last = span(node)[1]
                yield last - len(name), last, _NAMES[name].encode()
            case ast.Name(id=name) if name in _NAMES:
                yield *span(node), _NAMES[name].encode()


def _is_reshape(node: ast.Call) -> bool:
    return isinstance(node.func, ast.Attribute) and node.func.attr == "reshape"


def _constant(value: float) -> float:
    """A value far enough away to matter: 10 x, x / 10 for a large integer, the next small one."""
    if isinstance(value, float):
        return 10 * value or 1.0
    return value + 1 if value < LARGE else value // LARGE


def _alive(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes whose change can matter: no annotations, messages, decorators and imports."""
    for name, value in ast.iter_fields(node):
        if isinstance(node, ast.keyword) and node.arg == "strict":  # of zip: a check, no result
            continue
        if name in {"annotation", "returns", "decorator_list"}:
            continue
        if isinstance(node, ast.Call) and _is_reshape(node) and name == "args":
            continue  # wrong shapes raise; -2 means -1
        for child in value if isinstance(value, list) else [value]:
            idle = ast.Raise | ast.Import | ast.ImportFrom | ast.JoinedStr
            if isinstance(child, ast.AST) and not isinstance(child, idle):
                yield child
                yield from _alive(child)
