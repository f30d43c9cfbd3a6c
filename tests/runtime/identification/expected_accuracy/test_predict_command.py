"""`python -m runtime predict`: what it prints, draws and refuses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording, write_recording
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.excitation.search.information import FRICTION
from runtime.identification.expected_accuracy.expected import Knowledge, expected
from runtime.identification.expected_accuracy.planned_samples import MotionSamples
from runtime.library import Library
from tests.runtime.conftest import Command
from tests.runtime.trials import SIGMA, T, with_friction


@pytest.fixture
def motion(lib: Library, trajectories: tuple[Trajectory, ...], tmp_path: Path) -> Path:
    """A motion's file."""
    write_motion(trajectories[0], lib, tmp_path / "motion.json")
    return tmp_path / "motion.json"


def test_predict(
    command: Command,
    lib: Library,
    motion: Path,
    noisy: Recording,
    moved: MotionSamples,
    tmp_path: Path,
) -> None:
    """Property: options reach the numbers; motion, log and plot; the stop rule ends the output."""
    robot = ("--robot", lib.folder)
    ran = command("predict", motion, *robot, "--noise", ",".join(map(str, SIGMA)), "--json")
    assert ran.code == 0, ran.err
    reported = json.loads(ran.out)
    one = expected(lib, moved.statistics(lib, SIGMA), Knowledge.of(lib), 1.0, FRICTION)
    assert reported["base_parameters"]["least_squares"] == pytest.approx(list(one.base), rel=1e-9)
    assert reported["links"][lib.link_names[6]]["mass"] == pytest.approx(one.pi[60], rel=1e-9)
    assert reported["payload"]["mass"] == pytest.approx(one.payload.pi[0], rel=1e-9)
    assert (reported["n_eff"], reported["noise_from_residuals"]) == (1001, False)
    faster = command(
        "predict",
        motion,
        *robot,
        "--settings",
        "log_rate=400",
        "--settings",
        "friction=none",
        "--json",
    )
    other = json.loads(faster.out)
    assert (other["n_samples"], other["friction"]) == (4001, [])
    write_recording(noisy, tmp_path / "log.npz")
    words = ("--more", motion, "--settings", "earlier_log=log.npz", "--settings", "plot=sigma.png")
    ran = command("predict", "log.npz", *robot, *words)
    assert ran.code == 0, ran.err
    assert "RMS of the log's residuals" in ran.out
    assert "earlier logs counted" in ran.out
    assert re.search(r"^10 s more of motion improve payload mass by \d+ %.*: go on$", ran.out, re.M)
    assert (tmp_path / "sigma.png").read_bytes()[:4] == b"\x89PNG"
    ran = command(
        "predict", "log.npz", *robot, "--more", "same", "--settings", "payload_only=true", "--json"
    )
    reported = json.loads(ran.out)
    assert [entry["seconds"] for entry in reported["more"]] == [10, 30, 60]
    assert reported["more"][0]["gains"].keys() == {"payload mass", "payload CoM", "payload inertia"}
    # As often as there are samples: √(1001/2001).
    assert reported["more"][0]["gains"]["payload mass"] == pytest.approx(
        1 - np.sqrt(1001 / 2001), 0.01
    )
    assert "base_parameters" not in reported
    assert reported["torque_noise"] == pytest.approx([0.05] * 7, rel=0.1)


def test_noise_of_a_log_counts_its_model_error(
    command: Command, lib: Library, motion: Path, noisy: Recording, tmp_path: Path
) -> None:
    """Oracle: `predict` of that log, which has the same motion, rate, residuals and N_eff."""
    rippled = noisy.replace(tau=noisy.tau + 0.3 * np.sin(8 * noisy.q))
    write_recording(rippled, tmp_path / "log.npz")
    robot, names = ("--robot", lib.folder), ("--settings", f"friction={','.join(FRICTION)}")
    plan = ("predict", motion, *robot, *names)
    by_log = json.loads(command(*plan, "--noise", "log.npz", "--json").out)
    white = json.loads(command(*plan, "--noise", "0.05", "--json").out)
    measured = json.loads(command("predict", "log.npz", *robot, *names, "--json").out)
    assert (by_log["noise_log"], by_log["noise_from_residuals"]) == ("ideal", False)
    assert (white["noise_log"], measured["noise_log"]) == (None, None)
    assert by_log["torque_noise"] == measured["torque_noise"]
    assert by_log["n_eff"] == pytest.approx(measured["n_eff"], rel=1e-9)
    assert by_log["n_eff"] < 0.5 * by_log["n_samples"]
    least_squares = [r["base_parameters"]["least_squares"] for r in (by_log, measured, white)]
    # Rounding × cond² of raw columns.
    assert least_squares[0] == pytest.approx(least_squares[1], rel=1e-6)
    assert (np.array(least_squares[0]) > 2 * np.array(least_squares[2])).all()
    note = "note: σ counts independent torque noise alone"
    assert note in command(*plan).out
    ran = command(*plan, "--noise", "log.npz")
    assert note not in ran.out
    assert "(RMS of the residuals of ideal)" in ran.out


def test_earlier_logs_reach_the_prediction(lib: Library, moved: MotionSamples) -> None:
    """Oracle: information of an earlier log with unknown friction adds as numbers over β."""
    dq = moved.samples.dq
    rows = with_friction(lib.base_regressor(moved.samples.q, dq, moved.samples.ddq), dq, FRICTION)
    whitened = rows / np.tile(SIGMA, 1001)[:, None]
    inverse = np.linalg.inv(np.linalg.inv(whitened.T @ whitened)[:43, :43])
    known = Knowledge.of(lib)
    earlier = replace(known, earlier=inverse)
    reported = expected(lib, moved.statistics(lib, SIGMA), earlier)
    alone = expected(lib, moved.statistics(lib, SIGMA), known)
    assert alone.base is not None
    # As much information again: √2; rounding × cond² of raw columns.
    assert reported.base == pytest.approx(alone.base / np.sqrt(2), rel=1e-5)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("nowhere.json",), "'nowhere.json' is not a trajectory"),
        (("still.json",), "nothing moves in 'still'"),
        (("motion.json", "--noise", "0"), "torque noise above 0"),
        (("motion.json", "--noise", "1,2"), "--noise needs 7 numbers"),
        (("motion.json", "--noise", "nowhere.csv"), "nowhere.csv"),
        (("motion.json", "--noise", "other.npz"), "has 6 joints, the robot 'fr3"),
        (("motion.json", "--settings", "log_rate=0"), "sampling rate above 0 Hz"),
        (("motion.json", "--settings", "log_rate=787694"), "at most 300,000 rows, got "),
        (
            ("motion.json", "--settings", "rate=50"),
            "is a planned motion; give --settings log_rate=NUMBER",
        ),
        (
            ("other.npz", "--settings", "log_rate=50"),
            "is a log; give --settings rate=HZ to decimate it",
        ),
        (
            ("motion.json", "--settings", "friction=sticky"),
            "no friction column 'sticky'; choose from",
        ),
        (("other.npz",), "has 6 joints, the robot 'fr3"),
        (("motion.json", "--more", "other.npz"), "has 6 joints, the robot 'fr3"),
        (("foreign.json",), "belongs to another robot"),
        (
            ("short.json", "--settings", "payload_only=true"),
            "does not determine all ten parameters of a payload",
        ),
        (("motion.json", "--settings", "plot=sigma.txt"), "expected an image file with the suffix"),
        (("motion.json", "--settings", "earlier_log=nowhere.csv"), "nowhere.csv"),
    ],
)
def test_bad_input(
    command: Command, lib: Library, motion: Path, words: tuple[str, ...], match: str
) -> None:
    """Property: one sentence, code 2, no file."""
    facts = json.loads(motion.read_text())
    a = np.array(facts["coefficients"])

    def put(name: str, **changes: object) -> None:
        (motion.parent / name).write_text(json.dumps(facts | changes))

    put("still.json", coefficients=(0 * a).tolist())
    put("foreign.json", joints=["a"] * 7)
    alone = 0 * a
    alone[0] = a[0]
    put("short.json", coefficients=alone.tolist())
    six = Recording(T, *(np.ones((1001, 6)),) * 4, name="other")
    write_recording(six, motion.parent / "other.npz")
    before = sorted(motion.parent.iterdir())
    ran = command("predict", *words, "--robot", lib.folder)
    assert ran.code == 2, ran.out
    assert match in ran.err
    assert len(ran.err.splitlines()) == 1
    assert sorted(motion.parent.iterdir()) == before
