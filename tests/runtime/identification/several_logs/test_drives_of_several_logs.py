"""Several logs of a commanded torque: their ends, and the dry friction that they have in common."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from runtime.identification.drive.estimate import with_drives
from runtime.identification.identify import identify
from runtime.identification.prepared_log import PreparedLog
from runtime.identification.settings import Settings
from runtime.library import load
from runtime.recording import Friction, Preparation, read_recording
from runtime.recording.friction.model import DRIVE
from tests.runtime.servo_logs import dry_servo_log, random_servo, servo_arrays

PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0)


def test_named_friction_and_measured_torques_stay(tiny_built: Path, tmp_path: Path) -> None:
    """Property: columns that are named stay, and a measured torque is left as it was."""
    lib = load(tiny_built)
    log, _ = dry_servo_log(lib, tmp_path, memory=True, slope=0.0)
    usual = PreparedLog(log, PREPARATION, None, Friction(DRIVE))
    first, other = with_drives([usual, usual], lib, Settings(delay="auto"))
    assert first.friction is not None
    assert first.friction.columns == ("viscous", "dahl", "offset", "rotor")
    assert first.notes[-1].startswith("dry friction has a memory")
    assert other.friction == Friction(DRIVE)
    for each in (first, other):
        assert each.preparation == replace(PREPARATION, trim_s=0.1)
    named = Settings(friction="viscous,coulomb,offset,rotor")
    assert with_drives([usual, usual], lib, named)[0].friction == Friction(DRIVE)
    for left in (replace(usual, is_at_rest=True), replace(usual, recording=measured(log))):
        assert with_drives([left, left], lib, Settings()) == [left, left]


def test_friction_is_chosen_on_all_logs(tiny_built: Path, tmp_path: Path) -> None:
    """Property: a first log in which a memory does not show is not the only one that counts."""
    lib = load(tiny_built)
    logs = [dry_servo_log(lib, tmp_path, memory=each, slope=0.0)[0] for each in (False, True)]
    plain, other = (PreparedLog(each, PREPARATION, None, Friction(DRIVE)) for each in logs)
    chosen = with_drives([plain, other, other], lib, Settings())[0].friction
    assert chosen is not None
    assert chosen.columns == ("viscous", "dahl", "offset", "rotor")
    assert with_drives([plain, plain], lib, Settings())[0].friction == Friction(DRIVE)


def test_all_logs_tell_the_encoder_biases(tiny_built: Path, tmp_path: Path) -> None:
    """Oracle: biases of two logs of one arm, with intervals below those of each log alone."""
    lib, rng = load(tiny_built), np.random.default_rng(4)
    servo, logs = random_servo(lib, rng), []
    for name in ("one", "two"):
        arrays = servo_arrays(lib, servo, rng)
        del arrays["tau_true"]
        np.savez(tmp_path / f"{name}.npz", **arrays)  # type: ignore[arg-type]
        logs.append(read_recording(tmp_path / f"{name}.npz"))
    settings = Settings(
        cutoff=10.0, delay=float(servo.delay[0]), encoder_bias=True, friction=DRIVE, certify=False
    )
    alone, both = (identify(each, lib, settings).drive for each in (logs[0], logs))
    assert alone is not None
    assert both is not None
    assert (np.abs(both.bias - servo.bias) < 4 * both.bias_sigma).all()
    assert (both.bias_sigma < alone.bias_sigma).all()


def measured(log):
    """The log, its torque as if from a sensor."""
    return log.replace(torque_source="measured")
