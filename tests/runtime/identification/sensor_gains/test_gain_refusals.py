"""gains refuses in one sentence of advice."""

import numpy as np
import pytest

from runtime import Recording, write_recording
from runtime.errors import RuntimeFault
from runtime.identification.payload.body import KnownPayload, read_known_payload
from runtime.identification.sensor_gains import identify_gains
from runtime.recording import Friction, Recipe
from tests.runtime.identification.sensor_gains.weighed import BODY, COM, NOISE, TERMS, measured


def _joints(run: Recording) -> Recording:
    return Recording(run.t, run.q[:, :6], run.dq[:, :6], run.ddq[:, :6], run.tau[:, :6])


def _named(run: Recording, names: str) -> Recording:
    return run.replace(joint_names=tuple(names))


def _ripple(run: Recording) -> np.ndarray:
    return NOISE * np.sin(np.arange(run.tau.size)).reshape(run.tau.shape)


BAD = {
    "the same log": (lambda e, f: (e, e), {}, "hold the same torques; give one run without"),
    "the same log rounded": (
        lambda e, f: (e, e.replace(tau=np.round(e.tau, 3))),
        {},
        "hold the same torques",
    ),
    "other joints": (lambda e, f: (e, _joints(f)), {}, "different robots .*; give two runs of one"),
    "other names": (
        lambda e, f: (_named(e, "abcdefg"), _named(f, "gfedcba")),
        {},
        "different robots .a, b, .*; g, f, ",
    ),
    "other reading": (
        lambda e, f: (e, f.replace(recipe=Recipe(gear=((1.0,),)))),
        {},
        "read with different units",
    ),
    "the wrong order": (lambda e, f: (f, e), {}, "carries less than the empty one"),
    "nothing mounted": (
        lambda e, f: (e, e.replace(tau=e.tau + _ripple(e))),
        {},
        "3 kg changes the torques of these runs too little .* check that it was mounted",
    ),
    "the same log rounded to hundredths": (
        lambda e, f: (e, e.replace(tau=np.round(e.tau, 2))),
        {},
        "3 kg changes the torques of these runs too little",
    ),
    "too short": (lambda e, f: (e, f.take(slice(0, 30), "")), {}, "expected 50 samples .*, got 30"),
    "no torque": (lambda e, f: (e, f.replace(tau=None)), {}, "has no torque"),
    "no such link": (lambda e, f: (e, f), {"link": "hand"}, "no moving link 'hand'"),
    "another frame": (
        lambda e, f: (e, f),
        {"payload": KnownPayload(1.0, COM, frame="tool")},
        "in the frame of 'tool'",
    ),
    "no such column": (
        lambda e, f: (e, f),
        {"friction": Friction(("auto",))},
        "no friction column 'auto'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_runs_are_one_sentence_of_advice(case, runs, lib):
    """Property: a named error that says what to do."""
    change, options, message = BAD[case]
    with pytest.raises(RuntimeFault, match=message):
        identify_gains(*change(*runs), lib, **{"payload": BODY, "friction": TERMS, **options})


def test_a_search_that_has_not_converged_is_no_answer(runs, lib, monkeypatch):
    """Property: one step from the linear answer is not the optimum, however small its σ."""
    noise = NOISE * np.random.default_rng(6).normal(size=(2, *runs[0].tau.shape))
    monkeypatch.setattr("runtime.identification.sensor_gains._ITERATIONS", 1)
    with pytest.raises(RuntimeFault, match="changes the torques of these runs too little"):
        identify_gains(*measured(runs, noise), lib, BODY, friction=TERMS)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("0,0,0,0", "mass above 0 kg of the known payload, got 0; weigh it"),
        ("-1,0,0,0", "mass above 0 kg of the known payload, got -1"),
        ("nan,0,0,0", "mass above 0 kg of the known payload, got nan"),
        ("1,0,inf,0", "three finite numbers"),
        ("1,0,0", "expected the payload as MASS,CX,CY,CZ"),
        ("one,0,0,0", "expected the payload as MASS,CX,CY,CZ"),
        ("1,0,0,0,1,1,3,0,0,0", "is not physically consistent"),
        ("nowhere.json", "'.*nowhere.json' holds no payload"),
    ],
)
def test_impossible_payloads_are_refused(words, message):
    """Property: one sentence."""
    with pytest.raises(RuntimeFault, match=message):
        read_known_payload(words)


def test_the_command_refuses_with_one_sentence(runs, lib, command, tmp_path):
    """Property: exit code 2, one line, and nothing written."""
    write_recording(runs[0], tmp_path / "empty.csv")
    words = ("gains", "empty.csv", "empty.csv", "--robot", lib.folder, "--recipe-out", "r.toml")
    ran = command(*words, "--payload", "1,0,0,0")
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    assert "hold the same torques" in ran.err
    assert not (tmp_path / "r.toml").exists()
