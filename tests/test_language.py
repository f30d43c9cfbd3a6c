"""Language: words that no identifier carries, and docstrings that state arguments and results."""

import ast
import builtins
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.test_architecture import MODULES, REPOSITORY

AVOIDED = {
    *("told", "found", "own", "asked", "judged", "heard", "settled"),
    *("ladder", "rung", "course", "passage", "caution", "cautions", "sureness", "whiteness"),
}
"""Words that do not say what a variable holds; docs/contributing lists what is said instead."""


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax tree of one module."""
    return ast.parse(path.read_text(encoding="utf-8"))


def name_of(path: Path) -> str:
    """Path of a module as a test's id."""
    return path.relative_to(REPOSITORY).as_posix()


def identifiers(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Every identifier of a module with its line."""
    for node in ast.walk(tree):
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


def public_functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Public functions of a module and public methods of its public classes."""
    classes = [n for n in tree.body if isinstance(n, ast.ClassDef) and n.name[0] != "_"]
    for scope in (tree, *classes):
        for node in scope.body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                yield node


def parameters(function: ast.FunctionDef) -> list[str]:
    """Names of the parameters without self and cls."""
    every = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    return [each.arg for each in every if each.arg not in {"self", "cls"}]


def returns_something(function: ast.FunctionDef) -> bool:
    """False for functions that return None."""
    result = function.returns
    return result is not None and not (isinstance(result, ast.Constant) and result.value is None)


def missing_sections(function: ast.FunctionDef) -> list[str]:
    """What the docstring of a function of two or more parameters lacks."""
    text = ast.get_docstring(function) or ""
    before, _, after = text.partition("Args:")
    del before
    stated = after.split("\n\n")[0]
    lacking = [name for name in parameters(function) if not re.search(rf"\b{name}\b", stated)]
    if returns_something(function) and not re.search(r"^(Returns|Yields):", text, re.MULTILINE):
        lacking.append("Returns")
    return lacking


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_identifiers_use_the_words_of_the_field(path: Path) -> None:
    """Property: no identifier contains a word of the list above."""
    guilty = {f"{name} (line {line})" for name, line in identifiers(tree_of(path))
              if words_of(name) & AVOIDED and chosen_here(name)}  # fmt: skip
    assert not guilty


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_public_functions_state_arguments_and_results(path: Path) -> None:
    """Property: two or more parameters → Args names each of them, Returns says what comes back.

    Functions of command-line commands are excepted: their docstring is the text of --help.
    """
    guilty = {
        f"{function.name} (line {function.lineno})": missing_sections(function)
        for function in public_functions(tree_of(path))
        if len(parameters(function)) > 1 and not function.name.endswith("_command")
    }
    assert not {name: lacking for name, lacking in guilty.items() if lacking}


def test_the_checks_of_this_file_can_fail() -> None:
    """Property: a module with both faults is seen."""
    tree = ast.parse('def f(told, b) -> int:\n    """F.\n\n    Args:\n        b: x.\n    """\n')
    assert any(words_of(name) & AVOIDED for name, _ in identifiers(tree))
    assert missing_sections(next(public_functions(tree))) == ["told", "Returns"]
