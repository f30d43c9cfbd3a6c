"""Logs of all joints of a mechanism: `inspect` checks those of the independent ones."""

from pathlib import Path

import numpy as np
import pytest

from runtime import Recording, write_recording
from runtime.errors import IdentificationError
from runtime.inspection import inspect_log
from runtime.library import Library
from tests.runtime.library.test_coupled_library import A, B, motion


def written(wrist: Library, path: Path, share: float) -> Path:
    """A log of four joints; the torque of the first follower is a share of the first one's."""
    t, q, dq, ddq = motion(600)
    drives = wrist.inverse_dynamics(q, dq, ddq, wrist.pi0) + wrist.known_torque(q) + 0.4 * dq
    drives += np.random.default_rng(0).normal(0, 0.05, drives.shape)
    tau = np.column_stack([drives, share * drives[:, 0], 0 * t])
    write_recording(Recording(t, q @ A.T + B, dq @ A.T, None, tau), path)
    return path


def test_inspect_checks_the_independent_joints(wrist: Library, tmp_path: Path) -> None:
    """Property: the plan names the columns of q, by which the log has as many joints as q; torques
    on joints that follow others have no place in it and are refused.
    """
    seen = inspect_log(written(wrist, tmp_path / "log.csv", 0.0), wrist)
    assert seen.recording.n_joints == wrist.n_joints
    assert seen.plan.position.columns == ("q1", "q2")
    assert "all_joints" in [finding.kind for finding in seen.findings]
    again = inspect_log(tmp_path / "log.csv", wrist, seen.plan)
    np.testing.assert_array_equal(again.recording.q, seen.recording.q)
    with pytest.raises(IdentificationError, match="torques act on joints that follow others"):
        inspect_log(written(wrist, tmp_path / "driven.csv", 0.5), wrist)
