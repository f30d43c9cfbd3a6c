"""payload refuses in one sentence of advice."""

import numpy as np
import pytest

from runtime import identify_payload, write_recording
from runtime.errors import RuntimeFault
from runtime.identification.payload.arm_error import ArmModel
from runtime.recording import Friction, Preparation


@pytest.fixture(scope="module")
def arm(pi_true):
    return ArmModel(pi_true, Friction(()), np.zeros((7, 0)), "the truth", is_exact=True)


BAD = {
    "another link": (
        lambda run: (run, {"link": "wrist"}),
        "no moving link 'wrist'; choose one of fr3_link1, .*or the tip fr3_link8",
    ),
    "too few rows": (lambda run: (run.take(slice(0, 30), ""), {}), "30 samples.*50 or more"),
    "a shorter empty run": (
        lambda run: (run, {"empty": run.take(slice(0, 500), "")}),
        "lasts 4.99 s, the loaded one 10 s; record the same trajectory",
    ),
    "the same run": (
        lambda run: (run, {"empty": run.replace(name="bare")}),
        "'bare' and '.*' hold the same rows; give one run without and one with the payload",
    ),
    "another empty run": (
        lambda run: (run, {"empty": run.replace(q=run.q + 0.5 * np.eye(7)[0])}),
        "follows another trajectory: fr3_joint1 differs .* record the same trajectory",
    ),
    "NaN": (lambda run: (run.replace(tau=np.where(np.arange(7) == 2, np.nan, run.tau)), {}), "NaN"),
    "no torque": (lambda run: (run.replace(tau=None), {}), "has no torque"),
    "nothing moves the link": (
        lambda run: (run.replace(q=run.q * 0 + run.q[0], dq=run.q * 0, ddq=run.q * 0), {}),
        "separated from a torque offset; record a motion",
    ),
    "a filter too fast": (
        lambda run: (run, {"preparation": Preparation(filter="butterworth", cutoff_hz=60.0)}),
        "cutoff_hz expects",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_sentence_of_advice(case, ideal_runs, lib, arm):
    """Property: a named error that says what to do."""
    make, message = BAD[case]
    run, options = make(ideal_runs[0])
    with pytest.raises(RuntimeFault, match=message):
        identify_payload(run, lib, arm=arm, **options)


def test_the_command_refuses_with_one_sentence(ideal_runs, lib, command, tmp_path):
    """Property: exit code 2, one line, and nothing written."""
    write_recording(ideal_runs[0], tmp_path / "loaded.csv")
    ran = command("payload", "loaded.csv", "--robot", lib.folder, "--settings", "link=hand")
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    assert "no moving link 'hand'; choose one of fr3_link1" in ran.err
    assert not (tmp_path / "results").exists()
