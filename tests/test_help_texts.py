"""Texts of `--help`: what the console takes for markup is printed."""

import shlex
import sys
from pathlib import Path

import pytest
import typer
from rich.text import Text

import runtime.cli
import symgen.cli
import symgen.cli.console
from runtime.common.commands import GROUPS, Command, imported
from runtime.library.library import find


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

NOT_RUN = {
    **dict.fromkeys(("build", "check", "proxies", "clean", "undo"), "needs or changes a build"),
    **dict.fromkeys(("excite", "approach", "campaign", "compare", "reproduce"), "takes long"),
    **dict.fromkeys(
        ("rerun", "export", "report", "inspect", "friction", "fleet"), "other tests do"
    ),
    "locate": "may download",
    "view": "serves until it is interrupted",
}
"""Pages whose first example no test runs, each with the reason."""


def examples(command: Command) -> list[str]:
    """Lines of the examples of a page."""
    _, example, *_ = (imported(command).help or "").split("\n\n")
    return example.strip().split("\n")


def test_first_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: what a page shows first runs as it is printed, in an empty folder, page by page."""
    monkeypatch.chdir(tmp_path)
    ran, ends = set(), {}
    for command in COMMANDS:
        if command.name not in NOT_RUN:
            for line in examples(command):
                if line not in ran:
                    ends[line] = _exit_code(line, monkeypatch)
                    ran.add(line)
                if f" {command.name} " in f"{line} ":
                    break
    # Findings about a log or a model are no failure.
    assert {line: end for line, end in ends.items() if end > (" inspect " in line)} == {}


def _exit_code(line: str, monkeypatch: pytest.MonkeyPatch) -> int:
    words = shlex.split(line.replace("$(symgen locate fr3)", str(find("fr3").folder)))
    monkeypatch.setattr(sys, "argv", ["symgen", *words[words.index("symgen") + 1 :]])
    try:
        symgen.cli.console.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: f"{c.name}-{c.argument}")
def test_pages_begin_with_an_example(command: Command) -> None:
    """Property: behind the sentence stands a command, of the page itself or one that leads to it.

    Examples of a result that exists already name the folder that the first run of `identify` with
    the bundled log writes.
    """
    lines = examples(command)
    starts = ("symgen ", "python -m symgen ", "python -m runtime ")
    assert lines[0].startswith(starts)
    assert any(f" {command.name} " in f"{line} " for line in lines)
