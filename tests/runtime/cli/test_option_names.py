"""Names of options: one meaning in all commands."""

import typer

from runtime.cli import app
from tests.runtime.conftest import Command


def test_words_after_two_dashes_are_arguments(command: Command) -> None:
    """Property: `--` ends the options, so a file may be called like one."""
    assert "No such option" not in command("view", "--", "--export").err


def test_a_file_in_one_command_is_no_flag_in_another() -> None:
    """Property: an option takes a value in all commands or in none."""
    group = typer.main.get_command(app)
    kinds: dict[str, set[bool]] = {}
    for each in group.commands.values():  # type: ignore[attr-defined]
        for p in each.params:
            if p.param_type_name == "option":
                kinds.setdefault(p.opts[0], set()).add(bool(p.is_flag))
    assert [name for name, flags in kinds.items() if len(flags) > 1] == []
