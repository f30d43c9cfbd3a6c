"""Texts of `--help`: what the console takes for markup is printed."""

import pytest
import typer
from rich.text import Text

import runtime.cli
import symgen.cli
from runtime.common.commands import GROUPS, Command, imported


@pytest.mark.parametrize("module", [symgen.cli, runtime.cli], ids=lambda m: m.__name__)
def test_brackets_are_printed(module: object) -> None:
    """Property: no help text loses a name in brackets, such as that of a table of a TOML file."""
    group = typer.main.get_command(module.app)  # type: ignore[attr-defined]
    helps = [
        parameter.help or ""
        for command in group.commands.values()  # type: ignore[attr-defined]
        for parameter in (*command.params, *command.settings)
        if hasattr(parameter, "help")
    ]
    assert len(helps) > 50
    assert [text for text in helps if "[]" in Text.from_markup(text).plain] == []


COMMANDS = [each for group in GROUPS.values() for each in group]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: f"{c.name}-{c.argument}")
def test_pages_begin_with_an_example(command: Command) -> None:
    """Property: behind the sentence stands a command, of the page itself or one that leads to it.

    Examples of a result that exists already name the folder that the first run of `identify` with
    the bundled log writes.
    """
    made = imported(command)
    _, example, *_ = (made.help or "").split("\n\n")
    lines = example.strip().split("\n")
    starts = ("symgen ", "python -m symgen ", "python -m runtime ")
    assert lines[0].startswith(starts)
    assert any(f" {command.name} " in f"{line} " for line in lines)
