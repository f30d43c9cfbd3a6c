"""`identify --delay --settings stream=true`: the delay of the first rows is that of the whole
log.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.identification import long_logs as blocks
from runtime.library import load
from tests.runtime.conftest import Command
from tests.runtime.servo_logs import random_servo, servo_arrays


def test_a_streamed_log_has_a_delay(
    tiny_built: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: a log of 4 blocks and a bit, whose torque acts late; auto and a number agree.

    Four standard deviations are left with a probability of 6e-5. Every block loses the rows at
    its edges for which the late torque is unknown, and the overlap replaces them. Error of the log
    held in memory: first weights come from windows, some percent.
    """
    monkeypatch.setattr(blocks, "BLOCK", 2048)
    lib, rng = load(tiny_built), np.random.default_rng(2)
    servo = random_servo(lib, rng)
    arrays = servo_arrays(lib, servo, rng, seconds=45.0)
    logged = {key: values for key, values in arrays.items() if key != "tau_true"}
    np.savez(tmp_path / "log.npz", **logged)  # type: ignore[arg-type]
    words = (
        "identify",
        "log.npz",
        "--robot",
        lib.folder,
        "--cutoff",
        10,
        "--settings",
        "report=false",
    )
    ran = command(*words, "--settings", "stream=true", "--delay", "auto", "--out", "auto")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "auto/result.json").read_text())
    late = facts["delay_s"]
    assert abs(late["value"] - servo.delay[0]) < 4 * late["sigma"]
    assert any("from the first 2048 rows" in note for note in facts["warnings"])
    number = command(
        *words, "--settings", "stream=true", "--delay", late["value"], "--out", "number"
    )
    assert number.code == 0, number.err
    same = json.loads((tmp_path / "number/result.json").read_text())
    error = "torque_error_percent"
    assert same[error]["after_overall"] == pytest.approx(facts[error]["after_overall"], rel=1e-9)
    held = command(
        *words,
        "--settings",
        "stream=false",
        "--settings",
        "refit=false",
        "--delay",
        late["value"],
        "--out",
        "held",
    )
    assert held.code == 0, held.err
    whole = json.loads((tmp_path / "held/result.json").read_text())
    assert facts[error]["after_overall"] == pytest.approx(whole[error]["after_overall"], rel=0.05)
    words = (*words, "--settings", "stream=true", "--delay", late["value"])
    ran = command(*words, "--settings", "encoder_bias=true", "--out", "biased")
    assert ran.code == 0, ran.err
    biased = json.loads((tmp_path / "biased/result.json").read_text())
    for drive, bias in zip(biased["drive"], servo.bias, strict=True):
        assert abs(drive["encoder_bias"] - bias) < 4 * drive["sigma"]["encoder_bias"]
        assert drive["sigma"]["viscous"] > 0
