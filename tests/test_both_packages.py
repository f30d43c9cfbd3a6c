"""Sentences of both packages name the program that was started."""

import sys

import pytest

from runtime.common.terminal import as_typed


@pytest.mark.parametrize("program", ["/usr/bin/symgen", "/lib/symgen/__main__.py"])
def test_commands_of_the_build_are_typed_alike(
    program: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a command in a sentence is written as the user typed his."""
    monkeypatch.setattr(sys, "argv", [program])
    sentence = "it is missing; run: python -m symgen build --robot ur5e"
    assert ("python" in as_typed(sentence)) == program.endswith(".py")
