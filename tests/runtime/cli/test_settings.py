"""Settings of the commands: one record is the options, the keys of a file, and what is written."""

import tomllib
from dataclasses import fields
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

import numpy as np
import pytest

from runtime.common.commands import GROUPS, CheckedCommand, Command, imported
from runtime.common.errors import RuntimeFault
from runtime.common.settings import CONSENT, Choice, choices_of, stated_settings
from runtime.estimators.methods import METHODS
from runtime.excitation.limits.safety import Safety
from runtime.excitation.search.design_settings import DesignSettings
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import Preparation, Recording, Split, write_recording

COMMANDS = [each for group in GROUPS.values() for each in group]


def record_command(name: str) -> CheckedCommand:
    """Command of Typer."""
    return imported(next(each for each in COMMANDS if each.name == name and not each.argument))


def example_of(choice: Choice) -> Any:
    """A value of a file that differs from the default."""
    kind = next(each for each in (*get_args(choice.kind), choice.kind) if each is not NoneType)
    listed = next((each for each in (choice.kind, kind) if get_origin(each) is list), None)
    if listed is not None:
        return [2.5, 3.5] if get_args(listed) == (float,) else ["a", "b"]
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
    choices = [
        each for each in choices_of(made.record) if each.name != CONSENT and not each.info.is_eager
    ]
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


PRIOR = "[friction.fr3_joint1]\ncoulomb = [0.3, 0.1]\n"
OBSTACLES = '[[obstacle]]\nname = "cup"\ncenter = [0.6, 0.3, 0.2]\nradius = 0.1\n'
OF_IDENTIFY = {
    "gain_sigma": 0.005,
    "method": "map", "prior": "prior.toml", "friction": "viscous",
    "coulomb_speed": 0.1, "cutoff": 7, "rate": 50, "regressor": "momentum", "delay": 0.01,
    "encoder_bias": True, "symmetric": ["a:b"], "tie": True, "split": [0.5, 0.6],
    "validation": "log.csv", "test": "log.csv", "lam0": [0.1] * 70, "seed": 3, "certify": False,
    "refit": False, "robust": True, "friction_prior": "prior.toml", "rows": "all",
}  # fmt: skip
OF_EXCITE = {
    "duration": 7, "harmonics": 3, "starts": 2, "seed": 1, "home": [0.1] * 7, "criterion": "v",
    "basis": "fourier", "noise": 0.1, "margin": 0.5, "torque_fraction": 0.5, "clearance": 0.1,
    "table": 0, "box": [-1, 1, -1, 1, 0, 2], "viscous": 1, "coulomb": 2, "carry": [1, 0, 0, 0.1],
    "obstacles": "cell.toml", "payload_band": [0.1, 0.2], "friction_band": 10,
}  # fmt: skip


def by_file(command: str, table: dict[str, Any]) -> Any:
    """Record of a command from a file."""
    Path("s.toml").write_text("".join(f"{key} = {_toml(value)}\n" for key, value in table.items()))
    words = ["log.csv"] if command == "identify" else []
    with record_command(command).make_context(command, [*words, "--settings", "s.toml"]) as ctx:
        values = {key: value for key, value in ctx.params.items() if key != "settings"}
    record = record_command(command).record
    assert record is not None
    return record(**values)


def unlike(record: Any, default: Any) -> set[str]:
    """Fields of a record that differ from those of another."""
    pairs = ((each.name, getattr(record, each.name), getattr(default, each.name))
             for each in fields(record))  # fmt: skip
    return {name for name, a, b in pairs if a is not b and (b is None or not np.array_equal(a, b))}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lib: Library) -> Path:
    """Folder of files that settings name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "prior.toml").write_text(PRIOR)
    (tmp_path / "cell.toml").write_text(OBSTACLES)
    (tmp_path / "steps.toml").write_text("[preparation]\ntrim_s = 0.3\n")
    t = np.arange(3.0)
    write_recording(Recording(t, *[np.zeros((3, lib.n_joints))] * 2), tmp_path / "log.csv")
    return tmp_path


def test_every_field_of_python_is_reachable_by_the_file(lib: Library, folder: Path) -> None:
    """Property: the file of `identify` and `excite` sets each field of the records of Python."""
    fitted = by_file("identify", OF_IDENTIFY).fitted(lib)
    steps = by_file("identify", {"preparation": "steps.toml"}).fitted(lib)
    assert steps.preparation == Preparation(trim_s=0.3)
    keys = {field.name for field in choices_of(record_command("identify").record)}
    assert {name for each in METHODS for name in METHODS[each].files} <= keys
    adam = by_file("identify", {"preset": "real"}).fitted(lib)
    reached = unlike(fitted, Settings()) | unlike(adam, Settings()) | {"preparation", "inputs"}
    assert reached == {each.name for each in fields(Settings)}
    given = by_file("excite", OF_EXCITE)
    safety = given.limits(lib)
    design, _, _ = given.designed(lib, safety)
    assert unlike(design, DesignSettings()) == {each.name for each in fields(DesignSettings)}
    assert unlike(safety, Safety()) == {each.name for each in fields(Safety)}


def test_one_number_splits_off_the_test(lib: Library, folder: Path) -> None:
    """Property: B alone is 0.8 B,B, the proportion of the default."""
    (one, two) = (by_file("identify", {"split": each}).fitted(lib) for each in ([0.5], [0.4, 0.5]))
    assert one.split == two.split
    assert by_file("identify", {"split": [0.6]}).fitted(lib).split == Split()


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


def test_words_add_to_a_list(tmp_path: Path) -> None:
    """Property: NAME=VALUE adds to the values of earlier words, and replaces those of a file."""
    file = tmp_path / "f.toml"
    file.write_text('calibrate = ["a.csv", "b.csv"]\n')
    words = ("log.csv", "--model", "m", "--settings", str(file))
    one, two = (("--settings", f"calibrate={name}.csv") for name in "cd")
    assert params_of("observe", *words)["calibrate"] == ["a.csv", "b.csv"]
    assert params_of("observe", *words, *one, *two)["calibrate"] == ["c.csv", "d.csv"]


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


def test_numbers_out_of_range() -> None:
    """Property: the bounds of an option hold for the setting."""
    with pytest.raises(RuntimeFault, match="the setting 'seed': Input should be greater"):
        params_of("identify", "log.csv", "--settings", "seed=-1")


@pytest.mark.parametrize(("key", "value"), [("seed", "[" * 20_000), ("starts", "9" * 400)])
def test_values_that_no_text_holds(key: str, value: str) -> None:
    """Property: what the TOML reader cannot hold is a text, and no number."""
    with pytest.raises(RuntimeFault, match=f"{key} expects a whole number") as fault:
        params_of("excite", "--settings", f"{key}={value}")
    assert len(str(fault.value)) < 500


def test_bytes_of_another_code() -> None:
    """Property: an argument that is no UTF-8, whose bytes Python keeps as surrogates."""
    with pytest.raises(RuntimeFault, match="--settings expects Unicode text"):
        params_of("excite", "--settings", "seed=\udcff")


MOST, MOST_OF_A_COMMAND = 190, 16
"""Largest numbers of options of all commands together, and of one."""
IDENTIFY = "robot recipe run method friction cutoff delay prior split out settings overwrite"
EXCITE = (
    "robot duration budget criterion noise table box obstacles carry from return until export "
    "speed out settings"
)


def options_of(command: Command) -> set[str]:
    """Options of the command line, without --help."""
    params = [each for each in imported(command).params if each.param_type_name == "option"]
    return {each.opts[0].removeprefix("--") for each in params} - {"help"}


def test_number_of_options() -> None:
    """Property: what most users decide is on the command line, the rest in the settings."""
    counts = {f"{each.name} {each.argument}": len(options_of(each)) for each in COMMANDS}
    assert {name for name, count in counts.items() if count > MOST_OF_A_COMMAND} == set()
    assert sum(counts.values()) <= MOST
    named = {each.name: each for each in COMMANDS}
    assert options_of(named["identify"]) == set(IDENTIFY.split())
    assert options_of(named["excite"]) == set(EXCITE.split())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("identify", "log.csv", "--rate", "10"), "--rate is a setting of identify; give "
                                                  "--settings rate=VALUE, or rate = … in the"),
        (("identify", "log.csv", "--no-refit"), "give --settings refit=false"),
        (("excite", "--pictures"), "give --settings pictures=true"),
    ],
)  # fmt: skip
def test_an_option_that_moved_says_where_it_is(words: tuple[str, ...], sentence: str) -> None:
    """Property: one sentence with what to write in its place."""
    with pytest.raises(RuntimeFault) as fault:
        params_of(*words)
    assert sentence in str(fault.value)
