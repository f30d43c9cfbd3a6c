"""Names of options: one meaning in all commands, and earlier names are refused."""

from pathlib import Path

import pytest
import typer

from runtime.cli import app
from runtime.cli.renamed_options import RENAMED
from tests.runtime.conftest import Command

CASES = [(command, old) for command, options in RENAMED.items() for old in options]


def options() -> dict[str, set[str]]:
    """Option names of every command."""
    group = typer.main.get_command(app)
    return {
        name: {word for p in command.params if p.param_type_name == "option" for word in p.opts}
        for name, command in group.commands.items()  # type: ignore[attr-defined]
    }


@pytest.mark.parametrize(("name", "old"), CASES)
@pytest.mark.parametrize("form", ["{}", "{}=1"])
def test_an_earlier_name_is_refused(
    command: Command, name: str, old: str, form: str, tmp_path: Path
) -> None:
    """Property: exit code 2, one sentence with a name that the command has, no file."""
    present = options()[name]
    assert old not in present
    ran = command(name, "x", form.format(old))
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(f"runtime: '{name}' has no option {old} any more; give --")
    assert ran.err.count("\n") == 1
    assert present & set(
        ran.err.partition("; give ")[2].replace(",", " ").replace(";", " ").split()
    )
    assert not list(tmp_path.iterdir())


def test_words_after_two_dashes_are_arguments(command: Command) -> None:
    """Property: `--` ends the options, so a file may be called like an earlier one."""
    assert "any more" not in command("view", "--", "--export").err


def test_a_file_in_one_command_is_no_flag_in_another() -> None:
    """Property: an option takes a value in all commands or in none."""
    group = typer.main.get_command(app)
    kinds: dict[str, set[bool]] = {}
    for each in group.commands.values():  # type: ignore[attr-defined]
        for p in each.params:
            if p.param_type_name == "option":
                kinds.setdefault(p.opts[0], set()).add(bool(p.is_flag))
    assert [name for name, flags in kinds.items() if len(flags) > 1] == []
