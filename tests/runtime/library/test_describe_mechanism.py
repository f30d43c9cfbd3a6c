"""`symgen describe` of robots whose links outnumber the entries of q."""

import json

import pytest
from rich.console import Console

from runtime.library import Library
from tests.symgen.test_cli import run


@pytest.mark.parametrize(
    ("robot", "line"),
    [
        ("wrist", "= 1 trunk_turn - 2.5 left_lift + 0.3"),
        ("palletizer", "by the loops"),
        ("hopper", "free"),
    ],
)
def test_joints_that_follow_others(
    robot: str,
    line: str,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Property: joints that are not independent are listed with what moves them, and base
    parameters combine the parameters of all links.
    """
    monkeypatch.setattr("runtime.common.terminal.console", Console(width=160))  # no cell is folded
    lib: Library = request.getfixturevalue(robot)
    root = lib.folder.parent
    code, said, _ = run(capsys, "describe", lib.folder.name, "--out", root)
    assert (code, line in said) == (0, True)
    facts = json.loads(run(capsys, "describe", lib.folder.name, "--json", "--out", root)[1])
    assert [joint["name"] for joint in facts["all_joints"]][-1] == lib.all_joint_names[-1]
    assert any(lib.link_names[-1] in text for text in facts["base_parameters"])
