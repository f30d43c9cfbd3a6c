"""Functions that stand in both packages, because neither imports the other: the copies agree."""

import ast
import inspect
import sys
from collections.abc import Callable

import pytest

import runtime.cli.common
import symgen.cli.common

PAIRS = [
    (runtime.cli.common.flowing, symgen.cli.common.flowing),
]


def statements(function: Callable) -> list[str]:
    """Statements of a function without its docstring."""
    (node,) = ast.parse(inspect.getsource(function)).body
    assert isinstance(node, ast.FunctionDef)
    return [ast.dump(each) for each in node.body[ast.get_docstring(node) is not None :]]


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair[0].__name__)
def test_copies_have_the_same_statements(pair: tuple[Callable, Callable]) -> None:
    """Property: a change of one copy is a change of the other."""
    one, other = pair
    assert statements(one) == statements(other) != []


@pytest.mark.parametrize("program", ["/usr/bin/symgen", "/lib/symgen/__main__.py"])
def test_commands_of_the_build_are_typed_alike(
    program: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: sentences of symgen name its commands alone, and read as those of runtime."""
    monkeypatch.setattr(sys, "argv", [program])
    sentence = "it is missing; run: python -m symgen build --robot ur5e"
    assert symgen.cli.common.as_typed(sentence) == runtime.cli.common.as_typed(sentence)
    assert ("python" in symgen.cli.common.as_typed(sentence)) == program.endswith(".py")
