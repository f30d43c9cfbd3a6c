"""Friction of drives that changes with the position: the column, and its choice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.result import DriveRequest
from runtime.identification.settings import Settings
from runtime.library import load
from runtime.recording import Friction, Preparation, read_recording
from runtime.recording.friction import DRIVE, JointMotion, columns
from tests.runtime.servo_logs import KP, random_servo, servo_arrays


@pytest.mark.parametrize("varies", [True, False])
def test_position_is_chosen_where_friction_changes_with_it(tiny_built: Path, tmp_path, varies):
    """Property: the column is taken where the log needs it, with its coefficient, and else not.

    The interval of four standard deviations is left with a probability of 6e-5.
    """
    lib, rng = load(tiny_built), np.random.default_rng(0)
    servo = replace(random_servo(lib, rng), delay=np.zeros(1), bias=np.zeros(1), pi=lib.pi0)
    arrays = servo_arrays(lib, servo, rng, seconds=12.0, noise=0.02)
    motion = JointMotion(arrays["dq"], arrays["q"], lib=lib)
    column = columns(motion, Friction(columns=("position",)))[:, :, 0]
    slope = 2.0 if varies else 0.0
    arrays["q_des"] = arrays["q_des"] + slope * column / KP
    logged = {key: values for key, values in arrays.items() if key != "tau_true"}
    np.savez(tmp_path / "log.npz", **logged)  # type: ignore[arg-type]
    settings = Settings(preparation=Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.2))
    log = read_recording(tmp_path / "log.npz")
    result = identify_drive(log, lib, settings, DriveRequest(delay=True))
    assert result.friction.columns == (*DRIVE, "position")[: 5 if varies else 4]
    assert any("changes with the position" in note for note in result.notes) == varies
    drive = result.drive
    assert drive is not None
    if varies:
        assert abs(result.phi[0, 4] - slope) < 4 * drive.phi_sigma[0, 4]
    named = replace(settings, friction_columns=Friction(columns=DRIVE))
    assert identify_drive(log, lib, named, DriveRequest()).friction.columns == DRIVE


def test_position_runs_from_one_limit_to_the_other(tiny_built: Path):
    """Oracle: x is −1 at the lower limit, 1 at the upper one, and the sign is that of the speed."""
    lib = load(tiny_built)
    limits = lib.limits()
    low, high = limits["lower"][0], limits["upper"][0]
    q = np.array([[low], [high], [(low + high) / 2], [high]])
    dq = np.array([[1.0], [1.0], [1.0], [-1.0]])
    terms = Friction(columns=("position",), coulomb_speed=1e-3)
    values = columns(JointMotion(dq, q, lib=lib), terms)[:, 0, 0]
    np.testing.assert_allclose(values, [-1.0, 1.0, 0.0, -1.0], atol=1e-12)
