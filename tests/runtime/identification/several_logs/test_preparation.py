"""The preparation of several logs reaches the result, and evaluate compares it with its own."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import read_recording, write_recording
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.recording import Preparation
from tests.runtime.conftest import Command
from tests.runtime.motions import moving

RECIPE = """
[preparation]
filter = "butterworth"
cutoff_hz = 20.0
rate_hz = 100.0
max_gap_s = 0.005
"""


@pytest.fixture(scope="module")
def folder(lib, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of 6 s at 500 Hz with noise, and a recipe with a filter."""
    place = tmp_path_factory.mktemp("logs")
    whole = moving(lib, 6000)
    for k in range(2):
        log = whole.take(slice(3000 * k, 3000 * k + 3000), "cut")
        write_recording(log, place / f"{k}.npz")
    (place / "recipe.toml").write_text(RECIPE)
    return place


def errors(command: Command, *words: object) -> tuple[float, list[str]]:
    ran = command("evaluate", *words, "--json")
    assert ran.code == 0, ran.err
    facts = json.loads(ran.out)
    return facts["torque_error_percent"]["after_overall"], facts["notes"]


def test_the_filter_of_several_logs_is_that_of_evaluate(command, lib, folder, tmp_path):
    """Property: no note that no low-pass was used, and evaluate filters as identify did.

    The 0.05 N·m of noise are a third of it behind the filter.
    """
    logs, robot = (folder / "0.npz", folder / "1.npz"), ("--robot", lib.folder)
    recipe = ("--recipe", folder / "recipe.toml")
    ran = command("identify", *logs, *robot, *recipe, "--out", "out", "--verbose")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    expected = {"filter": "butterworth", "cutoff_hz": 20.0, "rate_hz": 100.0, "max_gap_s": 0.005}
    assert facts["recording"]["preparation"] == expected
    assert "no low-pass was used" not in ran.out
    # The bare log, without the recipe, is prepared as identify did.
    error, notes = errors(command, "out", logs[0], *robot)
    assert any("prepared as the log of identify" in note for note in notes)
    same, _ = errors(command, "out", logs[0], *robot, *recipe)
    assert error == same
    # Every fifth row has steps longer than the gaps of identify, and is no row of gaps.
    write_recording(read_recording(logs[0]).take(slice(None, None, 5), "thinned"), "slow.npz")
    thinned, _ = errors(command, "out", tmp_path / "slow.npz", *robot)
    # White noise of a fifth of the rows has five times the density in the band of the filter.
    assert thinned == pytest.approx(np.sqrt(5) * error, rel=0.2)


def test_another_filter_of_evaluate_is_reported(command, lib, folder, tmp_path):
    """Property: both filters in one sentence, where they differ and only there."""
    robot, log = ("--robot", lib.folder), folder / "0.npz"
    at_20 = ("--cutoff", "20", "--settings", "rate=100")
    assert command("identify", log, *robot, *at_20, "--out", "one").code == 0
    _, notes = errors(command, "one", log, *robot, "--cutoff", "5", "--settings", "rate=100")
    said = [note for note in notes if "do not compare" in note]
    assert len(said) == 1
    assert "low-pass at 20 Hz" in said[0]
    assert "low-pass at 5 Hz" in said[0]
    _, notes = errors(command, "one", log, *robot, *at_20)
    assert not any("do not compare" in note for note in notes)


def test_fitted_rows_are_no_test(command, lib, folder, tmp_path):
    """Property: under another name and format they are recognised, and a log given twice is named;
    of a result without refit, the rows before its test part are.
    """
    robot, bare = ("--robot", lib.folder), ("--friction", "none", "--settings", "report=false")
    write_recording(read_recording(folder / "0.npz"), tmp_path / "copy.csv")
    assert command("identify", folder / "0.npz", *robot, *bare, "--out", "one").code == 0
    assert "torque error on fitted data" in command("evaluate", "one", "copy.csv", *robot).out
    assert "fitted to 100 % of the rows" in errors(command, "one", "copy.csv", *robot)[1][0]
    assert not errors(command, "one", folder / "1.npz", *robot)[1]
    words = ("--settings", "refit=false", "--out", "half")
    assert command("identify", folder / "0.npz", *robot, *bare, *words).code == 0
    assert "fitted to 6" in errors(command, "half", "copy.csv", *robot)[1][0]
    words = ("--out", "two", "--verbose")
    ran = command("identify", folder / "0.npz", "copy.csv", *robot, *bare, *words)
    assert "0 and copy share 100 % of their rows; give each log once" in ran.out
    assert "agree within their noise" not in ran.out


def test_logs_that_are_prepared_unlike_are_named(lib):
    """Property: the result has the preparation of the first log, and names the others."""
    whole = moving(lib, 4000)
    logs = [
        NamedLog(f"log {hz:g}", whole.take(slice(2000 * k, 2000 * k + 2000), "cut"), prepared)
        for k, hz in enumerate((20.0, 10.0))
        for prepared in [Preparation(filter="butterworth", cutoff_hz=hz)]
    ]
    result = identify_recording(logs, lib, "ols")
    assert result.train.prepared == logs[0].preparation
    assert any("another way than log 20: log 10;" in note for note in result.notes)
    assert np.isfinite(result.beta).all()
