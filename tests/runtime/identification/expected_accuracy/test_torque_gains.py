"""Errors of an identified model by wrong gains of the torque sensors."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import write_recording
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import write_motion
from runtime.excitation.search.criteria import unseen_joints
from runtime.identification.expected_accuracy.expected import Knowledge, gain_slopes, unseen_torque
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    motion_samples_of,
    planned_recording,
)
from runtime.library import Library
from runtime.recording import Friction
from tests.runtime.conftest import Command
from tests.runtime.trials import with_friction

NAMES = ("viscous", "coulomb", "offset")
FAINT = np.full(2, 1e-6)
"""Noise, N·m, beside which the prior has no weight."""


def swing(double: Library) -> Trajectory:
    a = np.random.default_rng(0).uniform(-0.05, 0.05, (2, 4))
    return Trajectory(double.home, a, 4.0)


@pytest.fixture(scope="module")
def swung(double: Library) -> MotionSamples:
    """A motion of two joints at 100 Hz."""
    t = np.arange(401) / 100
    planned = planned_recording(swing(double), t, double, "swung")
    return motion_samples_of(planned, double, None, Friction(NAMES))


def test_a_wrong_gain_by_least_squares(double: Library, swung: MotionSamples) -> None:
    """Oracle: numpy's least squares over base parameters and friction, with one torque scaled."""
    s = swung.samples
    rows = double.base_regressor(s.q, s.dq, s.ddq)
    whole = with_friction(rows, s.dq, NAMES)
    beta = double.base_matrix @ double.pi0
    slopes = double.base_matrix @ gain_slopes(double, swung, FAINT, Knowledge.of(double))
    for joint in range(2):
        wrong = np.zeros(rows.shape[:2])
        wrong[:, joint] = rows[:, joint] @ beta
        x = np.linalg.lstsq(whole, wrong.ravel(), rcond=None)[0]
        # The prior and rounding × cond² of raw columns.
        assert slopes[:, joint] == pytest.approx(x[: len(beta)], abs=1e-5 * np.abs(beta).max())


def test_a_common_gain_scales_the_model(double: Library, swung: MotionSamples) -> None:
    """Property: Σ s_j = π over the base, so that the error of the torque is that share of it."""
    slopes = gain_slopes(double, swung, FAINT, Knowledge.of(double))
    beta = double.base_matrix @ double.pi0
    common = double.base_matrix @ slopes.sum(axis=1)
    assert common == pytest.approx(beta, abs=1e-5 * np.abs(beta).max())  # as above
    unseen = unseen_joints(double, double.home)
    scaled = np.sqrt([(0.01 * beta) @ joint @ (0.01 * beta) for joint in unseen])
    one = unseen_torque(0.01 * double.base_matrix @ slopes.sum(axis=1, keepdims=True), unseen)
    assert one == pytest.approx(scaled, rel=1e-4)


def test_a_strong_prior_does_not_follow_a_gain(double: Library, swung: MotionSamples) -> None:
    """Property: with noise far above the torque the model stays at the URDF."""
    slopes = gain_slopes(double, swung, np.full(2, 1e6), Knowledge.of(double))
    assert np.abs(slopes).max() < 1e-6 * np.abs(double.pi0).max()  # (τ / σ)²


def test_predict_states_both(command: Command, double: Library, tmp_path: Path) -> None:
    """Property: the option reaches σ, whose square is that of the noise and of the gains."""
    write_motion(swing(double), double, tmp_path / "motion.json")
    plan = ("predict", "motion.json", "--robot", double.folder)
    usual = json.loads(command(*plan, "--json").out)
    less = json.loads(command(*plan, "--settings", "gain_error=0.001", "--json").out)
    noise = np.array(usual["torque_of_unseen_motions"])
    assert less["torque_of_unseen_motions"] == noise.tolist()
    both = [np.array(one["torque_of_unseen_motions_with_gains"]) for one in (usual, less)]
    assert (usual["gain_error"], less["gain_error"]) == (0.005, 0.001)
    parts = [both[0] ** 2 - noise**2, both[1] ** 2 - noise**2]
    assert parts[0] == pytest.approx(25 * parts[1], rel=1e-9)  # rounding of the difference
    lines = command(*plan).out.splitlines()
    shown = ", ".join(f"{1000 * one:.2f}" for one in both[0])
    off = "0.5 % off (the setting gain_error), which residuals hardly show"
    start = f"with torque gains that may be {off}"
    assert f"{start}: {shown} mN·m" in lines
    assert "the setting gain_error" not in command(*plan, "--settings", "gain_error=0").out
    ran = command(*plan, "--settings", "gain_error=-1")
    assert ran.code == 2
    assert "the setting gain_error is a share of one, such as 0.005, got -1" in ran.err
    alone = command(*plan, "--settings", "payload_only=true", "--settings", "gain_error=0.01")
    assert alone.code == 2
    assert "which --settings payload_only=true does not print; leave out one of them" in alone.err


def test_rows_of_power_are_named(command: Command, double: Library, tmp_path: Path) -> None:
    """Property: the accuracy for a recipe of energy is that of momentum, and the first line says
    so.
    """
    log = planned_recording(swing(double), np.arange(401) / 100, double, "log")
    noise = 0.01 * np.random.default_rng(1).normal(size=log.q.shape)
    tau = double.inverse_dynamics(log.q, log.dq, log.ddq, double.pi0) + noise
    write_recording(log.replace(tau=tau), tmp_path / "log.npz")
    first = {}
    for form in ("energy", "momentum"):
        text = f'[preparation]\nregressor = "{form}"\ncutoff_hz = 10\n'
        (tmp_path / f"{form}.toml").write_text(text)
        ran = command("predict", "log.npz", "--robot", double.folder, "--recipe", f"{form}.toml")
        assert ran.code == 0, ran.err
        first[form], *_ = ran.out.splitlines()
    assert first["energy"] == first["momentum"] + (
        "; rows of momentum, which show more than the rows of energy that the recipe states"
    )
