"""Commands within messages begin with the program that the user started."""

import sys
from types import ModuleType

import pytest

import runtime.cli
import symgen.cli


@pytest.mark.parametrize(
    ("package", "words", "sentence"),
    [
        (runtime.cli, ["identify", "log.csv", "--robot", "absent"], "or run: symgen build "),
        (symgen.cli, ["describe", "absent"], "robot; symgen list names"),
    ],
)
@pytest.mark.parametrize("program", ["/usr/bin/symgen", "/lib/runtime/__main__.py"])
def test_messages_state_commands_as_they_are_typed(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    package: ModuleType,
    words: list[str],
    sentence: str,
    program: str,
) -> None:
    """Property: `symgen …` where the user started that, else `python -m …`."""
    monkeypatch.setattr(sys, "argv", [program, *words])
    with pytest.raises(SystemExit) as end:
        package.main()
    assert end.value.code == 2
    assert (sentence in capsys.readouterr().err) == program.endswith("symgen")
