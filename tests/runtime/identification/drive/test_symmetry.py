"""Left and right side of mirrored joints: the statistic, the names, and the command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import samples_of
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.result import DriveRequest
from runtime.identification.drive.symmetry import RISES, mirrored_joints, sides_of, with_sides
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording import Preparation, read_recording
from tests.runtime.servo_logs import Servo, random_servo, servo_arrays

PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.3)
PAIRS = ("joint2:joint4", "joint1:joint3")


def written(lib: Library, servo: Servo, rng: np.random.Generator, folder: Path) -> Path:
    """A log of a servo arm."""
    arrays = servo_arrays(lib, servo, rng, seconds=12.0)
    np.savez(folder / "log.npz", **{k: v for k, v in arrays.items() if k != "tau_true"})  # type: ignore[arg-type]
    return folder / "log.npz"


def test_names_that_differ_in_one_part() -> None:
    """Property: pairs by their names; nothing to compare and other texts are refused."""
    names = ("FL_hip", "FL_calf", "FR_hip", "FR_calf", "RL_hip", "RR_hip")
    assert mirrored_joints(names, ("FL:FR", "RL:RR")) == ((0, 2), (1, 3), (4, 5))
    assert mirrored_joints(names, ()) == ()
    wrong = (("FL", "left:right"), ("a:a", "left:right"), ("x:y", "no joint with 'x'"))
    for text, message in wrong:
        with pytest.raises(IdentificationError, match=message):
            mirrored_joints(names, (text,))


def test_equal_drives_agree_and_a_worn_one_is_named(lib: Library, command, tmp_path: Path) -> None:
    """Property: joints with equal drives agree; the one with three times the friction does not, and
    the held-out error with the drive of the other side says that the robot is the reason.

    Two comparisons of equal drives at 95 % hold with a probability of 90 %; the seed is one of
    these. The rotor of joint 1 is not separated from its link, and is not compared here.
    """
    rng = np.random.default_rng(3)
    servo = random_servo(lib, rng)
    phi = servo.phi.copy()
    phi[3], phi[2] = phi[1], phi[0]
    phi[2, :2] *= 3.0
    log = written(lib, replace(servo, phi=phi), rng, tmp_path)
    result = identify_drive(
        read_recording(log), lib, Settings(preparation=PREPARATION), DriveRequest(delay=True)
    )
    compared = {
        (each.left[-1], each.quantity): each for each in with_sides(result, PAIRS).symmetric
    }
    assert set(compared) == {(k, q) for k in "12" for q in ("armature", "friction")}
    assert compared["2", "armature"].agrees
    assert compared["2", "friction"].agrees
    worn = compared["1", "friction"]
    assert not worn.agrees
    assert worn.exchanged_error_ratio is not None
    assert worn.exchanged_error_ratio > RISES
    others = result.phi.copy()
    for column in ("viscous", "coulomb"):  # rotors and offsets stay
        k = result.friction.columns.index(column)
        others[[0, 2], k] = result.phi[[2, 0], k]
    samples = samples_of(result.test, lib)
    rigid = samples.tau - samples.rigid(lib, result.pi)
    errors = [(rigid - samples.friction(each))[:, [0, 2]] for each in (others, result.phi)]
    rise = np.linalg.norm(errors[0]) / np.linalg.norm(errors[1])
    assert worn.exchanged_error_ratio == pytest.approx(rise, rel=1e-9)
    assert "the two drives differ" in worn.sentence
    root = result.friction_root
    for rise, said in ((1.04, "error is hardly larger"), (1.06, "1.06 times as large: the two")):
        pairs, _ = sides_of(
            *(lib.joint_names, PAIRS[1:], result.friction.columns, result.phi, root),
            np.ones((1, lib.n_joints)),
            lambda _, rise=rise: np.full((1, lib.n_joints), 1.0 - rise),
        )
        assert said in next(each.sentence for each in pairs if each.quantity == "friction")
    words = (
        "identify",
        str(log),
        "--robot",
        lib.folder,
        "--cutoff",
        "10",
        "--settings",
        "encoder_bias=false",
    )
    pairs = ("--settings", f"symmetric={PAIRS[0]}", "--settings", f"symmetric={PAIRS[1]}")
    ran = command(*words, *pairs, "--delay", "auto", "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    differ = {(e["left"][-1], e["quantity"]) for e in facts["symmetric"] if not e["agrees"]}
    assert ("1", "friction") in differ
    assert "Left and right" in (tmp_path / "out" / "report.html").read_text()
    ran = command(*words, "--settings", "symmetric=left:right", "--out", "other")
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    assert not (tmp_path / "other").exists()
