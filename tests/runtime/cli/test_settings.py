"""Settings of the commands: one record is the options, the keys of a file, and what is written."""

import tomllib
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

import pytest

from runtime.common.commands import GROUPS, CheckedCommand, Command, imported
from runtime.common.errors import RuntimeFault
from runtime.common.settings import CONSENT, Choice, choices_of, stated_settings

COMMANDS = [each for group in GROUPS.values() for each in group]


def record_command(name: str) -> CheckedCommand:
    """Command of Typer."""
    return imported(next(each for each in COMMANDS if each.name == name and not each.argument))


def example_of(choice: Choice) -> Any:
    """A value of a file that differs from the default."""
    kind = next(each for each in (*get_args(choice.kind), choice.kind) if each is not NoneType)
    if get_origin(choice.kind) is list or get_origin(kind) is list:
        return ["a", "b"]
    if isinstance(kind, type) and issubclass(kind, Enum):
        return list(kind)[-1].value
    if kind is bool:
        return choice.default is not True
    return 3 if kind is int else 2.5 if kind is float else "a"


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: f"{c.name}-{c.argument}")
def test_every_field_is_reachable_by_the_file(command: Command, tmp_path: Path) -> None:
    """Property: a file of all keys gives every field its value; the record that is written too."""
    made = imported(command)
    if made.record is None:
        return
    choices = [each for each in choices_of(made.record) if each.name != CONSENT]
    values = {each.key: example_of(each) for each in choices}
    file = tmp_path / "all.toml"
    file.write_text("".join(f"{key} = {_toml(value)}\n" for key, value in values.items()))
    if not made.settings:
        assert set(stated_settings(made.record, [str(file)])) == {each.name for each in choices}
        return
    with made.make_context(command.name, ["--settings", str(file)]) as ctx:
        params = {k: v for k, v in ctx.params.items() if k != "settings"}
    for each in choices:
        assert _plain(params[each.name]) == values[each.key], each.key
    written = made.record(**params).write(tmp_path / "result")
    table = tomllib.loads(written.read_text())
    assert table.pop("command") == command.name
    assert table == values


def _toml(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return list(map(_plain, value))
    return str(value) if isinstance(value, Path) else getattr(value, "value", value)


def params_of(name: str, *words: str) -> dict[str, Any]:
    """Fields of a command line."""
    with record_command(name).make_context(name, list(words)) as ctx:
        return ctx.params


def test_the_command_line_wins(tmp_path: Path) -> None:
    """Property: option over --settings, a later --settings over an earlier one."""
    file = tmp_path / "f.toml"
    file.write_text('friction = "viscous"\ncutoff = 7\nseed = 1\nsplit = [0.5, 0.6]\n')
    words = ("log.csv", "--settings", "seed=2", "--settings", str(file), "--cutoff", "9")
    params = params_of("identify", *words, "--settings", "seed=4")
    picked = {key: params[key] for key in ("friction", "cutoff", "seed", "split", "logs")}
    assert picked == {
        "friction": "viscous", "cutoff": "9", "seed": 4, "split": "0.5,0.6", "logs": ["log.csv"],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("friktion = 'viscous'", "has the unknown key 'friktion'; did you mean 'friction'"),
        ("seed = 1.5", "seed expects a whole number, got 1.5"),
        ("stream = 'yes'", "stream expects true or false, got 'yes'"),
        ("command = 'excite'", "has the settings of 'excite'; give those of 'identify'"),
        ("yes = true", "consent to run code counts only where it is typed"),
        ("seed = = 2", "expects a TOML file or NAME=VALUE"),
    ],
)
def test_bad_files(text: str, sentence: str, tmp_path: Path) -> None:
    """Property: one sentence on what was expected and what came."""
    file = tmp_path / "f.toml"
    file.write_text(text)
    with pytest.raises(RuntimeFault) as fault:
        params_of("identify", "log.csv", "--settings", str(file))
    assert sentence in str(fault.value)
