"""The same digits in Python and on the command line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import runtime
from runtime.library import Library
from runtime.recording import read_recording
from runtime.recording.streamed import open_log
from tests.runtime.conftest import Command


def parameters_of(command: Command, folder: Path, lib: Library, *words: object) -> dict[str, Any]:
    """Parameters and friction of result.json by the command."""
    ran = command(
        "identify", *words, "--robot", lib.folder, "--settings", "report=false", "--out", "out"
    )
    assert ran.code == 0, ran.err
    facts = json.loads((folder / "out" / "result.json").read_text())
    columns = facts["friction"]["columns"] if facts["friction"] else []
    return {"pi": facts["pi"], "columns": columns, "notes": facts["warnings"]}


def require_equal(facts: dict[str, Any], result: runtime.Identification) -> None:
    """Property: every digit of π, the friction columns, and the sentences on what was chosen."""
    assert result.pi.tolist() == facts["pi"]
    assert list(result.friction.columns) == facts["columns"]
    assert set(result.notes) <= set(facts["notes"])


@pytest.mark.parametrize("method", ["map", "pc-ols"])
def test_one_log(command: Command, fr3: Library, tmp_path: Path, method: str) -> None:
    """Property: friction choice and fit to all rows included; a bare fit is asked for."""
    facts = parameters_of(command, tmp_path, fr3, "fr3_simulated", "--method", method)
    log = read_recording("fr3_simulated")
    require_equal(facts, runtime.identify(log, fr3, method))
    assert runtime.identify(log, fr3, method, friction=(), refit=False).phi.size == 0


def test_a_streamed_log(command: Command, fr3: Library, tmp_path: Path) -> None:
    """Property: the log stays in its file for both."""
    facts = parameters_of(command, tmp_path, fr3, "fr3_simulated", "--settings", "stream=true")
    log = open_log("fr3_simulated", stream=True)
    require_equal(facts, runtime.identify(log, fr3))


def test_several_runs(command: Command, robot: Callable[[str], Library], tmp_path: Path) -> None:
    """Property: two runs of a real arm, an offset of each, the friction model of the first."""
    lib = robot("kuka_lwr4")
    facts = parameters_of(command, tmp_path, lib, "lwr4_flobaroid", "--run", "1,2")
    logs = [read_recording("lwr4_flobaroid", None, run) for run in ("1", "2")]
    result = runtime.identify(logs, lib)
    assert result.pi.tolist() == facts["pi"]
    assert list(result.friction.columns) == facts["columns"]
    assert result.agreement is not None
    assert len(result.agreement.leave_one_out) == 2


def test_a_commanded_torque(
    command: Command, robot: Callable[[str], Library], shared_data: Path, tmp_path: Path
) -> None:
    """Property: delay, encoder biases and dry friction of a real servo arm."""
    lib, path = robot("unitree_z1"), shared_data / "data" / "unitree_air" / "z1.npz"
    words = ("--cutoff", "10", "--delay", "auto")
    facts = parameters_of(command, tmp_path, lib, path, *words)
    result = runtime.identify(read_recording(path), lib, cutoff=10.0, delay="auto")
    require_equal(facts, result)
    assert result.drive is not None
    assert result.drive.delay.size == 1
