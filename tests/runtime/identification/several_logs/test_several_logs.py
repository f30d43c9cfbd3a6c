"""Several logs in one fit: offsets of their own, known payloads, a log left out, repeatability."""

import json

import numpy as np
import pytest

from runtime.errors import IdentificationError, RecordingError
from runtime.identification.payload.body import read_known_payload
from runtime.identification.result_file import write_result
from runtime.identification.several_logs import NamedLog, joined, read_carried
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.outputs.report.report import write_report
from runtime.recording import Friction, Preparation, write_recording
from runtime.recording.friction.model import columns
from runtime.recording.preprocessing import prepare
from runtime.recording.settings import JointMotion
from tests.runtime.conftest import Command
from tests.runtime.motions import COULOMB, VISCOUS, moving

PREPARATION = Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=100.0)
OFFSETS = np.array([[0.3] * 7, [-0.2] * 7, [0.0, 0.5, 0.0, 0.0, 0.0, 0.1, 0.2]])
FRICTION = Friction()


def load_of(lib: Library, mass: float = 1.5) -> np.ndarray:
    """A ball of 5 cm, 12 cm from the last link's origin, as what it adds to π."""
    com, single = np.array([0.02, 0.0, 0.12]), 0.4 * mass * 0.05**2
    inertia = single * np.eye(3) + mass * (com @ com * np.eye(3) - np.outer(com, com))
    pi = np.zeros((lib.n_joints, 10))
    entries = (inertia[0, 0], inertia[1, 1], inertia[2, 2], *inertia[[0, 0, 1], [1, 2, 2]])
    pi[-1] = (mass, *(mass * com), *entries)
    return pi.ravel()


@pytest.fixture(scope="module")
def sessions(lib: Library) -> list[NamedLog]:
    """Three stretches of a motion with offsets of their own; the second carries a payload."""
    identified = []
    for k in range(3):
        carried = load_of(lib) if k == 1 else None
        log = moving(lib, 9000, payload=carried).take(slice(k * 3000, k * 3000 + 3000), "cut")
        log = log.replace(tau=log.tau + OFFSETS[k])
        identified.append(NamedLog(f"run {k}", log, PREPARATION, carried))
    return identified


@pytest.fixture(scope="module")
def answer(lib: Library, sessions: list[NamedLog]):
    result = identify_recording(sessions, lib, friction=FRICTION)
    return result, result.agreement


def test_offsets_friction_and_payload_are_separated(lib, answer):
    """Oracle: the offsets that were put on, the friction and the arm without its payload.

    0.05 N·m of noise, 1440 rows at 100 Hz: 2 mN·m on a mean; beside gravity ten times that.
    """
    result, agreement = answer
    assert agreement.offsets == pytest.approx(OFFSETS, abs=0.02)
    assert result.usual_phi.shape == (7, 3)
    assert result.usual_phi[:, 0] == pytest.approx(VISCOUS, abs=0.02)
    assert result.usual_phi[:, 1] == pytest.approx(COULOMB, abs=0.02)
    assert result.usual_phi[:, 2] == pytest.approx(OFFSETS.mean(axis=0), abs=0.02)
    truth = lib.base_matrix @ lib.pi0
    assert np.abs((result.beta - truth) / result.uncertainty.beta_sigma).max() < 5
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, 4, 7))
    rigid = lib.inverse_dynamics(q, dq, ddq, result.pi)
    reported = columns(JointMotion(dq, q, ddq, lib), FRICTION)
    extra = np.einsum("ijk,jk->ij", reported, result.usual_phi)
    assert result.predict(q, dq, ddq) == pytest.approx(rigid + extra)


def test_parameters_come_from_all_rows(lib, sessions, answer, tmp_path):
    """Property: errors are those of the training rows, parameters those of all rows, as of one log;
    without the second fit both are the same.
    """
    first, _ = answer
    result = identify_recording(sessions, lib, friction=FRICTION, refit=True)
    assert first.trained is None
    assert result.trained is not None
    assert any("are fitted to all" in note for note in result.notes)
    np.testing.assert_array_equal(first.pi, result.trained.pi)
    assert (result.pi != first.pi).any()
    assert result.predict_test() == pytest.approx(first.predict_test())
    write_result(result, tmp_path, "test")
    facts = json.loads((tmp_path / "result.json").read_text())["trained"]
    assert np.shape(facts["friction_values"]) == (lib.n_joints, len(FRICTION.columns))


def test_a_payload_that_is_not_given_shows(lib, sessions):
    """Property: without its payload the odd log stands out in both tables."""
    unknown = [NamedLog(s.name, s.recording, s.preparation) for s in sessions]
    agreement = identify_recording(unknown, lib, friction=FRICTION).agreement
    single = [log.log_offset_overall for log in agreement.leave_one_out]
    assert single[1] > 10.0
    assert agreement.repeatability.ratio > 5.0
    assert "differ by more than noise" in agreement.repeatability.sentence


def test_logs_predict_each_other(answer):
    """Oracle: with its own offset a log left out is explained to the noise, as by its own fit."""
    _, agreement = answer
    for log in agreement.leave_one_out:
        assert log.log_offset_overall == pytest.approx(log.single_log_overall, rel=0.1)
        assert log.after_overall > 3 * log.log_offset_overall
        assert log.before_overall > log.after_overall
    assert 0.5 < agreement.repeatability.ratio < 2.0
    assert "agree" in agreement.repeatability.sentence
    assert agreement.payload_kg == pytest.approx((0.0, 1.5, 0.0))


def test_one_log_twice_without_offsets_is_one_log(lib, sessions):
    """Oracle: without offset columns, two halves of a log give the answer of both together."""
    terms = Friction(("viscous", "coulomb"))
    bare = [NamedLog(s.name, s.recording, s.preparation) for s in sessions[:1]]
    twice = [*bare, NamedLog("again", bare[0].recording, bare[0].preparation)]
    result = identify_recording(twice, lib, "ols", friction=terms)
    agreement = result.agreement
    alone = identify_recording(
        bare[0].recording, lib, "ols", preparation=PREPARATION, friction=terms
    )
    # The same rows twice: least squares does not notice, to rounding times the condition number.
    assert result.beta == pytest.approx(alone.beta, abs=1e-8)
    assert agreement.offsets is None
    assert np.array(agreement.repeatability.beta_spread) == pytest.approx(0.0, abs=1e-12)


def test_joined_logs_keep_every_row_and_a_hole(lib, sessions):
    """Property: rows, columns and the clock of joined logs."""
    parts = [prepare(s.recording, PREPARATION, FRICTION, lib=lib) for s in sessions[:2]]
    whole = joined(parts, ["a", "b"], ["a", "b", "c"])
    n = len(parts[0])
    assert whole.column_names == ("viscous", "coulomb", "offset a", "offset b", "offset c")
    assert np.array_equal(whole.q, np.concatenate([p.q for p in parts]))
    assert whole.columns[:n, :, 2] == pytest.approx(1.0)
    assert not whole.columns[n:, :, 2].any()
    assert not whole.columns[..., 4].any()
    assert np.diff(whole.t).max() == pytest.approx(10.0)


def test_what_is_written_can_be_used(answer, tmp_path):
    """Oracle: result.json serves evaluate and payload, the report shows both tables."""
    result, agreement = answer
    record = write_result(result, tmp_path, "test")
    assert record.friction.columns == ("viscous", "coulomb", "offset")
    assert tuple(each.name for each in record.sessions.leave_one_out) == agreement.names
    page = write_report(tmp_path).read_text()
    assert "Leave-one-log-out prediction" in page
    assert "Repeatability" in page


def test_command_with_several_logs(lib, sessions, tmp_path, command: Command):
    """Oracle: logs, the payload of one, and what does not go together, on the command line."""
    for session in sessions:
        write_recording(session.recording, tmp_path / f"{session.name[-1]}.npz")
    facts = {"link": lib.link_names[-1], "pi_in_link": load_of(lib)[-10:].tolist()}
    (tmp_path / "payload.json").write_text(json.dumps(facts))
    words = ("--robot", lib.folder, "--cutoff", "20", "--settings", "rate=100", "--out", "out")
    words += ("--friction", "viscous,coulomb,offset")
    logs = ("identify", "0.npz", "1.npz", "2.npz")
    ran = command(*logs, *words, "--settings", "payload_of=1.npz=payload.json")
    assert ran.code == 0, ran.err
    assert "repeatability: the base parameters" in ran.out
    reported = json.loads((tmp_path / "out" / "result.json").read_text())["sessions"]
    assert reported["payload_kg"] == pytest.approx([0.0, 1.5, 0.0])
    ran = command("evaluate", "out", "2.npz", "--robot", lib.folder)
    assert ran.code == 0, ran.err
    for extra, message in {
        (
            "--settings",
            "payload_of=3.npz=payload.json",
        ): "expects LOG=FILE with a log of 0.npz, 1.npz",
        ("--settings", "payload_of=1.npz=none.json"): "holds no payload",
        ("--method", "ekf"): "cannot join several logs",
        ("--settings", "stream=true"): "read as a whole",
    }.items():
        ran = command(*logs, *words, *extra)
        assert ran.code == 2
        assert message in ran.err
    ran = command(*logs, *words, "--friction", "auto", "--settings", "regressor=auto")
    assert ran.code == 0, ran.err
    reported = json.loads((tmp_path / "out" / "result.json").read_text())
    chosen = [note for note in reported["warnings"] if "chosen by cross-validation" in note]
    assert [note.partition(":")[0] for note in chosen] == ["0"]  # once, on the first log
    assert np.shape(reported["sessions"]["offsets"]) == (3, 7)
    ran = command("identify", "0.npz", *words, "--settings", "payload_of=0.npz=payload.json")
    assert "several logs" in ran.err


def test_wrong_payloads_and_names(lib, sessions, tmp_path):
    """Property: a payload of another link, and logs of one name, are one sentence."""
    path = tmp_path / "payload.json"
    path.write_text(json.dumps({"link": "hand", "pi_in_link": [1.0] * 10}))
    with pytest.raises(RecordingError, match="is mounted on hand, but 'fr3' has the links"):
        read_carried(path, lib)
    path.write_text(json.dumps({"link": lib.link_names[-1], "pi_in_link": [1.0] * 9}))
    with pytest.raises(RecordingError, match="holds no payload"):
        read_carried(path, lib)
    path.write_text(json.dumps({"format": 2, "link": "hand", "pi_in_link": [1.0] * 10}))
    for reader in (lambda: read_carried(path, lib), lambda: read_known_payload(str(path))):
        with pytest.raises(RecordingError, match="has the format 2, expected 1; update symgen"):
            reader()
    with pytest.raises(IdentificationError, match="two logs or more with different names"):
        identify_recording([sessions[0], sessions[0]], lib)
    with pytest.raises(IdentificationError, match="two logs or more"):
        identify_recording(sessions[:1], lib)
