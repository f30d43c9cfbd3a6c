"""Texts of `--help`: what the console takes for markup is printed."""

import pytest
import typer
from rich.text import Text

import runtime.cli
import symgen.cli


@pytest.mark.parametrize("module", [symgen.cli, runtime.cli], ids=lambda m: m.__name__)
def test_brackets_are_printed(module: object) -> None:
    """Property: no help text loses a name in brackets, such as that of a table of a TOML file."""
    group = typer.main.get_command(module.app)  # type: ignore[attr-defined]
    helps = [
        parameter.help or ""
        for command in group.commands.values()  # type: ignore[attr-defined]
        for parameter in command.params
        if hasattr(parameter, "help")
    ]
    assert len(helps) > 30
    assert [text for text in helps if "[]" in Text.from_markup(text).plain] == []
