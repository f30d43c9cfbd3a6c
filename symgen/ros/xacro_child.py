"""Process that expands one xacro file: a job of `packages` on standard input, an answer as JSON.

Limits are set before the file is opened. The functions of xacro that open files, evaluate
expressions and read the environment are replaced; $(find PACKAGE) searches in `Packages`. Names of
xacro that begin with an underscore are used because it offers no other way to confine a file.

Expressions have Python's operators, calls, comprehensions and lambdas, without its inside. The
check of the package xacro reads the names of the outermost code only, and $(eval …) has every
built-in function; both let a robot file run programs. Here an attribute is read by `attribute`, at
run time: an entry of a name space or of a YAML table, or a method of a number, text, list or table.
No name begins with two underscores, `str.format` (it reads attributes) is left out, `type` answers
for plain data, and `vars` is missing. A power of whole numbers is bounded (`power`).
"""

import ast
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from importlib import import_module
from pathlib import Path
from typing import Any

from runtime.common.child import serve
from runtime.common.files import LARGEST_DOCUMENT, text_of
from symgen.errors import SymgenError
from symgen.ros.packages import Packages

_SECRET = re.compile(r"TOKEN|SECRET|PASSW|CREDENTIAL|KEY", re.IGNORECASE)  # no robot needs these
_WORD = re.compile(r"[A-Za-z_]\w*")
_ARGUMENT = re.compile(r"""<xacro:arg\s[^<>]*?name\s*=\s*["']([^"']*)["']""")
_MOST_MESSAGES = 20
_LONGEST = 400  # largest length of a message [characters]
_MODIFIED = ("safe_eval", "parse", "load_yaml", "_global_symbols", "process_file")
_PLAIN = (str, bytes, list, tuple, dict, set, frozenset, range, int, float, complex, bool)
_METHODS = {
    kind: frozenset(name for name in dir(kind) if name[0] != "_") - {"format", "format_map"}
    for kind in _PLAIN
}
_REFUSED = (ast.NamedExpr, ast.Await, ast.Yield, ast.YieldFrom)
_ATTRIBUTE, _POWER = "__attribute__", "__power__"
MOST_BITS = 4096  # length of a power of whole numbers; a float ends at 2¹⁰²⁴


def _expand(job: dict[str, Any]) -> dict[str, Any]:
    xacro: Any = import_module("xacro")
    substitutions: Any = import_module("xacro.substitution_args")
    if any(not hasattr(xacro, name) for name in _MODIFIED) or not hasattr(substitutions, "_eval"):
        return {"reason": "this version of xacro is not supported; run: pip install 'xacro>=2.1'"}
    messages = sys.stderr = _Messages()
    files = Files(Path(job["path"]), Packages(tuple(map(Path, job["folders"]))))
    confine(xacro, substitutions, files)
    try:
        text = str(xacro.process_file(job["path"], mappings=job["arguments"]).toxml())
    except Exception as error:  # xacro raises what the expressions of the file raise
        return _refusal(error)
    unknown = sorted(job["arguments"].keys() - files.words)
    if unknown:
        names = ", ".join(_one_line(name) for name in files.arguments) or "none"
        return {
            "refused": f"the setting arg names '{unknown[0]}', which '{job['path']}' and its "
            f"includes do not contain; their arguments are: {names}"
        }
    if len(text) > LARGEST_DOCUMENT:
        return {"reason": f"the URDF has more than {LARGEST_DOCUMENT >> 20} MiB"}
    return {"text": text, "messages": messages.lines}


def _refusal(error: BaseException) -> dict[str, Any]:
    causes = list(_causes(error))
    for cause in causes:
        if isinstance(cause, SymgenError):
            return {"refused": str(cause)}
        if isinstance(cause, MemoryError):
            raise cause
        if isinstance(cause, RecursionError):
            return {"reason": "macros, includes or properties are nested without end"}
    return {"reason": _one_line(str(error)) or type(causes[-1]).__name__}


def _causes(error: BaseException) -> Iterator[BaseException]:
    """An error and the errors that xacro wrapped into it."""
    cause: BaseException | None = error
    while cause is not None:
        yield cause
        cause = getattr(cause, "exc", None)


def _one_line(text: str) -> str:
    """A text without line ends, control characters and its middle, if it is long."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text[: 2**20]).split())
    half = _LONGEST // 2
    return line if len(line) <= _LONGEST else f"{line[:half]} … {line[-half:]}"


class _Messages(io.TextIOBase):
    """The first messages that the file prints, as lines that a terminal does not interpret."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._rest = ""

    def write(self, text: str) -> int:
        *whole, rest = (self._rest + text).split("\n")
        self._rest = rest[-_LONGEST:]
        lines = (_one_line(each) for each in whole[:_MOST_MESSAGES])
        self.lines += [line for line in lines if line]
        del self.lines[_MOST_MESSAGES:]
        return len(text)


class Files:
    """Files that an expansion may read: those of its own package and of packages it names."""

    def __init__(self, path: Path, packages: Packages) -> None:
        """Allow the package of a file, or its folder where it is in none, and `packages`."""
        real = path.resolve()
        self.packages = packages  # where $(find PACKAGE) searches
        self.folders = [_package_of(real) or real.parent]  # whose files may be read
        self.folders += [folder.resolve() for folder in packages.folders]
        self.words: set[str] = set()  # names that occur in the files that were read
        self.arguments: dict[str, None] = {}  # of their <xacro:arg>, in the order of reading
        self._names: set[str] = set()

    def find(self, name: str) -> str:
        """Folder of a package, whose files may be read from now on."""
        folder = self.packages.folder(name).resolve()
        self.folders.append(folder)
        self._names.add(name)
        return str(folder)

    def open(self, name: str | Path, *_: str) -> io.StringIO:
        """Text of a file."""
        path = Path(name)
        if path.exists() and not self._may_read(path.resolve()):
            raise ValueError(
                f"'{path}' is outside of '{self.folders[0]}' and of the packages that the file "
                "names; allow its folder with --settings package=DIR"
            )
        try:
            text = text_of(path)
        except ValueError as error:
            raise ValueError(f"'{path}': {error}") from None
        self.words.update(_WORD.findall(text))
        self.arguments |= dict.fromkeys(_ARGUMENT.findall(text))
        return io.StringIO(text)

    def _may_read(self, real: Path) -> bool:
        if any(real.is_relative_to(folder) for folder in self.folders):
            return True
        # An installation of links: share/PACKAGE/x.xacro is a link to the sources of PACKAGE.
        package = _package_of(real)
        return package is not None and package.name in self._names


def _package_of(path: Path) -> Path | None:
    """Nearest folder above a file that holds a package.xml."""
    return next((folder for folder in path.parents if (folder / "package.xml").is_file()), None)


def confine(xacro: Any, substitutions: Any, files: Files) -> None:
    """Replace what opens files, evaluates expressions and reads the environment."""
    # Includes and load_yaml: a name of the module hides the built-in one.
    xacro.open = files.open
    xacro.safe_eval = evaluate
    names = xacro._global_symbols
    python = names["python"]
    for key in [*dict.keys(python)]:
        dict.pop(python, key)
    dict.update(python, BUILTINS)
    for key, value in [*names.items()]:
        if getattr(value, "__module__", "") == "builtins" and key not in BUILTINS:
            del names[key]
    substitutions._eval_find = files.find
    substitutions._eval_env = _environment
    substitutions._eval_optenv = _optional_environment
    functions = {**substitutions._eval_dict, **BUILTINS}
    functions |= {"env": _environment, "optenv": _optional_environment, "find": files.find}
    del functions["__builtins__"]

    def evaluated(text: str, context: dict[str, Any]) -> str:
        """Value of $(eval …), whose names are the arguments of the file."""
        stated = context.get("arg", {}).items()
        given = {name: substitutions.convert_value(value, "auto") for name, value in stated}
        return str(evaluate(text, given | functions | {"arg": lambda name: given[name]}))

    substitutions._eval = evaluated


def _environment(name: str) -> str:
    if _SECRET.search(name):
        raise ValueError(f"a robot description may not read the environment variable {name}")
    if name not in os.environ:
        raise ValueError(f"the environment variable {name} is not set")
    return os.environ[name]


def _optional_environment(name: str, default: str = "") -> str:
    return _environment(name) if name in os.environ else default


def _plain_type(value: Any) -> type:
    """Type of plain data."""
    if type(value) in _PLAIN or value is None:
        return type(value)
    raise TypeError("type() answers for numbers, texts, lists and tables only")


_FUNCTIONS = (
    *(list, dict, map, len, str, float, int, bool, min, max, round, sorted, range, abs, all, any),
    *(complex, divmod, enumerate, filter, frozenset, hash, isinstance, issubclass, ord, repr),
    *(reversed, slice, set, sum, tuple, zip),
)
BUILTINS: Mapping[str, Any] = {  # functions of Python in expressions
    **{function.__name__: function for function in _FUNCTIONS},
    "type": _plain_type,
    "True": True,
    "False": False,
}


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


if __name__ == "__main__":
    serve(_expand)
