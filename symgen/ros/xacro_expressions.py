"""Expressions of xacro: Python's operators, calls, comprehensions and lambdas, without its inside.

The check of the package xacro reads the names of the outermost code only, and $(eval …) has every
built-in function; both let a robot file run programs. Here an attribute is read by `attribute`, at
run time: an entry of a name space or of a YAML table, or a method of a number, text, list or table.
No name begins with two underscores, `str.format` (it reads attributes) is left out, `type` answers
for plain data, and `vars` is missing. A power of whole numbers is bounded (`power`).
"""

import ast
from collections.abc import Callable, Mapping, MutableMapping
from typing import Any

_PLAIN = (str, bytes, list, tuple, dict, set, frozenset, range, int, float, complex, bool)
_METHODS = {
    kind: frozenset(name for name in dir(kind) if name[0] != "_") - {"format", "format_map"}
    for kind in _PLAIN
}
_REFUSED = (ast.NamedExpr, ast.Await, ast.Yield, ast.YieldFrom)
_ATTRIBUTE, _POWER = "__attribute__", "__power__"
MOST_BITS = 4096
"""Length of a power of whole numbers; a float ends at 2¹⁰²⁴."""


def plain_type(value: Any) -> type:
    """Type of plain data."""
    if type(value) in _PLAIN or value is None:
        return type(value)
    raise TypeError("type() answers for numbers, texts, lists and tables only")


_FUNCTIONS = (
    *(list, dict, map, len, str, float, int, bool, min, max, round, sorted, range, abs, all, any),
    *(complex, divmod, enumerate, filter, frozenset, hash, isinstance, issubclass, ord, repr),
    *(reversed, slice, set, sum, tuple, zip),
)
BUILTINS: Mapping[str, Any] = {
    **{function.__name__: function for function in _FUNCTIONS},
    "type": plain_type,
    "True": True,
    "False": False,
}
"""Functions of Python in expressions."""


def evaluate(
    text: str, names: MutableMapping[str, Any], local: Mapping[str, Any] | None = None
) -> Any:
    """Return the value of an expression."""
    tree = ast.parse(text.strip(), "<expression>", "eval")
    for node in ast.walk(tree):
        if isinstance(node, _REFUSED):
            raise ValueError(f"an expression has no {type(node).__name__}")
        for name in _names_of(node):
            if name.startswith("__"):
                raise ValueError(f"'{name}': names with two underscores are not for expressions")
    code = compile(ast.fix_missing_locations(_Guards().visit(tree)), "<expression>", "eval")
    names.update({"__builtins__": {_ATTRIBUTE: attribute, _POWER: power}})
    return eval(code, names, local)  # type: ignore[arg-type]  # noqa: S307  checked above


def _names_of(node: ast.AST) -> tuple[str, ...]:
    if isinstance(node, ast.Name):
        return (node.id,)
    if isinstance(node, ast.Attribute):
        return (node.attr,)
    if isinstance(node, ast.arg | ast.keyword):
        return (node.arg or "",)
    return ()


class _Guards(ast.NodeTransformer):
    """value.name → attribute(value, "name"), and a ** b → power(a, b)."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Pow):
            return node
        name = ast.Name(_POWER, ast.Load())
        return ast.copy_location(ast.Call(name, [node.left, node.right], []), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        value: ast.expr = self.visit(node.value)
        name = ast.Name(_ATTRIBUTE, ast.Load())
        return ast.copy_location(ast.Call(name, [value, ast.Constant(node.attr)], []), node)


def power(base: Any, exponent: Any) -> Any:
    """Return base ** exponent."""
    if isinstance(base, int) and isinstance(exponent, int):
        bits = base.bit_length() * exponent
        if bits > MOST_BITS and base not in {-1, 1}:
            raise ValueError(
                f"expected a power of at most {MOST_BITS} bits, got one of up to "
                f"{float(min(bits, 10**300)):.3g}; write it as a float"
            )
    return base**exponent


def attribute(value: Any, name: str) -> Any:
    """Return an entry of a name space or YAML table, or a method of plain data."""
    kind = type(value)
    is_wrapped = kind.__module__ == "xacro" and isinstance(value, dict | list)
    base = kind if kind in _METHODS else None
    if is_wrapped and kind.__name__.startswith("Yaml"):
        base = dict if isinstance(value, dict) else list
    if base is None or name not in _METHODS[base]:
        if is_wrapped and isinstance(value, dict) and name in value:
            return value[name]
        what = "is not defined" if is_wrapped else f"of a {kind.__name__} is not for expressions"
        raise AttributeError(f"'{name}' {what}")
    method: Callable[..., Any] = getattr(value, name)
    return method
