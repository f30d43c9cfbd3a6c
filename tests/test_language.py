"""Language: words that no identifier carries, and docstrings that state arguments and results."""

import ast
import builtins
import re
from collections.abc import Iterable, Iterator
from functools import cache

from tests.test_architecture import is_overload, nodes_of_trees, trees

AVOIDED = {
    *("told", "found", "own", "asked", "judged", "heard", "settled"),
    *("ladder", "rung", "course", "passage", "caution", "cautions", "sureness", "whiteness"),
}
"""Words that do not say what a variable holds; docs/contributing lists what is said instead."""

SECTION = re.compile(r"^(Args|Returns|Yields|Raises):", re.MULTILINE)
SHAPE = re.compile(r"\((?:\.\.\.|N|K|n|L|10 L|blocks|orders|size|m),.*\)|[Ss]hape of")
"""Shape of a result, which its sentence may state in place of a section."""


def identifiers(nodes: Iterable[ast.AST]) -> Iterator[tuple[str, int]]:
    """Every identifier of a module with its line."""
    for node in nodes:
        if isinstance(node, ast.Name):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg | ast.keyword) and node.arg:
            yield node.arg, node.lineno
        elif isinstance(node, ast.Attribute):
            yield node.attr, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.alias):
            yield node.asname or node.name, node.lineno


@cache
def chosen_here(identifier: str) -> bool:
    """False for names that Python gives, such as FileNotFoundError."""
    return not hasattr(builtins, identifier)


@cache
def words_of(identifier: str) -> frozenset[str]:
    """Words of snake_case and of CamelCase, in lower case."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", identifier)
    return frozenset(word.lower() for word in re.split(r"[_.]", parted) if word)


def names_in_all(tree: ast.Module) -> list[str]:
    """Names that `__all__` of a module lists."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return [str(name) for name in ast.literal_eval(node.value)]
    return []


@cache
def exported() -> frozenset[tuple[str, str]]:
    """Module and name of all that some `__all__` lists, up to the definition."""
    seen: set[tuple[str, str]] = set()
    rest = [(module, name) for module, tree in trees().items() for name in names_in_all(tree)]
    while rest:
        module, name = rest.pop()
        if module not in trees() or (module, name) in seen:
            continue
        seen.add((module, name))
        for node in nodes_of_trees()[module]:
            if isinstance(node, ast.ImportFrom):
                taken = [each for each in node.names if (each.asname or each.name) == name]
                rest += [(node.module or "", each.name) for each in taken]
    return frozenset(seen)


@cache
def bases() -> frozenset[str]:
    """Names of the classes that others inherit from, and of protocols."""
    classes = [
        n for nodes in nodes_of_trees().values() for n in nodes if isinstance(n, ast.ClassDef)
    ]
    inherited = {
        ast.unparse(b).partition("[")[0].rpartition(".")[2] for c in classes for b in c.bases
    }
    abstract = {c.name for c in classes if any("Protocol" in ast.unparse(b) for b in c.bases)}
    return frozenset(inherited | abstract)


def functions(module: str) -> Iterator[tuple[ast.FunctionDef, bool, str]]:
    """Functions of a module and methods of its classes, whether others may call them, and what the
    docstring of the class says.
    """
    body = trees()[module].body
    for node in nodes_of_trees()[module]:
        if isinstance(node, ast.FunctionDef) and node in body and not is_overload(node):
            yield node, (module, node.name) in exported(), ""
        elif isinstance(node, ast.ClassDef):
            public = (module, node.name) in exported() or node.name in bases()
            for method in node.body:
                if isinstance(method, ast.FunctionDef):
                    said = ast.get_docstring(node) or ""
                    yield method, public and method.name[0] != "_", said


def parameters(function: ast.FunctionDef) -> list[str]:
    """Names of the parameters without self and cls."""
    every = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    return [each.arg for each in every if each.arg not in {"self", "cls"}]


def returns_something(function: ast.FunctionDef) -> bool:
    """False for functions that return None."""
    result = function.returns
    return result is not None and not (isinstance(result, ast.Constant) and result.value is None)


def missing_sections(function: ast.FunctionDef, of_class: str = "") -> list[str]:
    """What the docstrings of a function of two or more parameters, and of its class, lack."""
    text = ast.get_docstring(function) or ""
    sections = (each.partition("Args:")[2].split("\n\n")[0] for each in (text, of_class))
    named = "\n".join(sections)
    lacking = [name for name in parameters(function) if not re.search(rf"\b{name}\b", named)]
    stated = re.search(r"^(Returns|Yields):", text, re.MULTILINE) or SHAPE.search(text)
    if returns_something(function) and not stated:
        lacking.append("Returns")
    return lacking


def test_identifiers_use_the_words_of_the_field() -> None:
    """Property: no identifier contains a word of the list above."""
    guilty = {
        f"{module}:{line}: {name}"
        for module, nodes in nodes_of_trees().items()
        for name, line in identifiers(nodes)
        if words_of(name) & AVOIDED and chosen_here(name)
    }
    assert not guilty


def test_exported_functions_state_arguments_and_results() -> None:
    """Property: two or more parameters → Args names each of them, Returns or a shape the result.

    Arguments that methods share are stated once, by the Args of their class.
    Functions of command-line commands are excepted: their docstring is the text of --help.
    """
    guilty = {
        f"{module}:{function.lineno}: {function.name}": missing_sections(function, of_class)
        for module in trees()
        for function, public, of_class in functions(module)
        if public and len(parameters(function)) > 1 and not function.name.endswith("_command")
    }
    assert not {name: lacking for name, lacking in guilty.items() if lacking}


def test_other_functions_have_no_sections() -> None:
    """Property: what no `__all__` lists and no base class declares has neither Args nor Returns."""
    guilty = [
        f"{module}:{function.lineno}: {function.name}"
        for module in trees()
        for function, public, _ in functions(module)
        if not public and SECTION.search(ast.get_docstring(function) or "")
    ]
    assert guilty == []


def test_the_checks_of_this_file_can_fail() -> None:
    """Property: a module with both faults is seen."""
    tree = ast.parse('def f(told, b) -> int:\n    """F.\n\n    Args:\n        b: x.\n    """\n')
    assert any(words_of(name) & AVOIDED for name, _ in identifiers(ast.walk(tree)))
    function = next(node for node in tree.body if isinstance(node, ast.FunctionDef))
    assert missing_sections(function) == ["told", "Returns"]
    assert missing_sections(function, "C.\n\nArgs:\n    told: x.") == ["Returns"]
    assert SECTION.search(ast.get_docstring(function) or "")
    assert ("runtime.identification.identify", "identify") in exported()
