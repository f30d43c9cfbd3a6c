"""Unknown gain of the control law of every joint."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.estimators.problem import FrictionPrior
from runtime.identification.problem_setup import known_friction
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.friction.model import DRIVE
from runtime.recording.friction.model import torque as friction_torque
from runtime.recording.preprocessing import prepare
from tests.runtime.servo_logs import KD, KP, random_servo, servo_arrays

TERMS = Friction((*DRIVE, "law_gain"))
GIVEN = ("--friction", ",".join(TERMS.columns))


def write_servo(lib: Library, path: Path, gain: Array | float, seed: int = 0) -> Array:
    """Write a log of servos whose torque is `gain` times that of the law; φ of the drives."""
    rng = np.random.default_rng(seed)
    servo = replace(random_servo(lib, rng), delay=np.zeros(1), bias=np.zeros(lib.n_joints))
    arrays = servo_arrays(lib, servo, rng, seconds=15.0)
    arrays.pop("tau_true")
    q, dq = arrays["q"], arrays["dq"]
    torque = KP * (arrays["q_des"] - q) - KD * dq
    arrays["q_des"] = q + (torque / gain + KD * dq) / KP
    np.savez(path, **{key: np.ascontiguousarray(each) for key, each in arrays.items()})
    return servo.phi


def test_gains_and_their_intervals(lib: Library, tmp_path: Path) -> None:
    """Monte Carlo: ratios of gains, and intervals of gains and drives, over six robots."""
    inside, ratios = [], []
    for seed in range(6):
        gain = np.random.default_rng(100 + seed).uniform(0.8, 1.25, lib.n_joints)
        phi = write_servo(lib, tmp_path / "log.npz", gain, seed)
        log = read_recording(tmp_path / "log.npz")
        result = identify_recording(log, lib, friction=TERMS, refit=True)
        truth = np.column_stack([phi, gain - 1])
        sigma = result.friction_sigma
        inside.append(np.abs(result.phi - truth) < 1.96 * sigma)
        ratio = np.log((1 + result.phi[:, 4]) / gain)
        ratios.append(ratio - np.median(ratio))
        assert (sigma[:, 4] > 0.03).all()  # the common factor is that of the prior
    assert np.mean(inside) > 0.9
    # Gains differ by 13 %; the wrist moves 0.1 kg·m², beside 0.1 N·m of noise.
    assert np.median(np.abs(ratios)) < 0.01
    assert np.abs(ratios)[:, :4].max() < 0.04


def test_a_common_factor_is_that_of_the_prior(lib: Library, tmp_path: Path) -> None:
    """Property: with every torque of the law halved the gains double and the robot is the same."""
    results = []
    for factor in (1.0, 2.0):
        write_servo(lib, tmp_path / "log.npz", factor)
        log = read_recording(tmp_path / "log.npz")
        results.append(identify_recording(log, lib, friction=TERMS))
    one, two = results
    np.testing.assert_allclose(1 + two.phi[:, 4], 2 * (1 + one.phi[:, 4]), rtol=2e-3)
    np.testing.assert_allclose(two.phi[:, :4], one.phi[:, :4], rtol=5e-3, atol=2e-3)
    np.testing.assert_allclose(two.beta, one.beta, rtol=5e-3, atol=2e-3)


def test_a_gain_has_a_weak_prior_beside_stated_ones(lib: Library) -> None:
    """Property: σ of a gain is 10 where no prior is stated: friction alone determines no scale."""
    stated = FrictionPrior(np.ones((lib.n_joints, 5)), np.full((lib.n_joints, 5), np.inf))
    stated.sigma[:, 3] = 0.1
    known = known_friction(lib, Settings(friction_prior=stated), TERMS.columns, TERMS)
    assert known is not None
    np.testing.assert_array_equal(known.sigma[0], [*[np.inf] * 3, 0.1, 10.0])
    np.testing.assert_array_equal(known.mean[0, 3:], [1.0, 0.0])


def test_the_column_is_the_slope_by_the_gain(lib: Library, tmp_path: Path) -> None:
    """Derivative: (1 + g) τ = Y π + F φ by g, after the filter as well; refused where measured."""
    write_servo(lib, tmp_path / "log.npz", 1.0)
    log = read_recording(tmp_path / "log.npz")
    terms = Friction(("law_gain",))
    steps = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=100.0)
    done = prepare(log, steps, terms, lib=lib)
    h = 1e-4
    phi = np.full((lib.n_joints, 1), h)
    more, less = (done.tau - friction_torque(done.columns, s * phi) for s in (1, -1))
    np.testing.assert_allclose((more - less) / (2 * h), done.tau, rtol=1e-9, atol=1e-9)
    measured = Recording(log.t, log.q, log.dq, tau=log.tau)
    with pytest.raises(RecordingError, match=r"'commanded_torque' .*\[torque\] with a law"):
        prepare(measured, steps, terms, lib=lib)


def test_commands(lib: Library, tmp_path: Path, command) -> None:
    """`identify` with its sentence, `evaluate` on another log, `export`, and refusals."""
    gain = np.linspace(0.85, 1.2, lib.n_joints)
    for name, seed in (("log", 0), ("second", 7)):
        write_servo(lib, tmp_path / f"{name}.npz", gain, seed)
    ran = command("identify", "log.npz", *GIVEN, "--out", "with")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "with" / "result.json").read_text())
    said = next(each for each in facts["warnings"] if "gains of the control law" in each)
    assert "only ratios are determined" in said
    assert "the prior of the links alone fixes it" in said
    assert f"{lib.joint_names[0]} " in said
    values = np.array(facts["friction"]["values"])[:, 4]
    assert np.corrcoef(values, gain)[0, 1] > 0.98
    assert facts["torque_error_percent"]["after_overall"] < 5
    assert command("identify", "log.npz", "--friction", ",".join(DRIVE), "--out", "bare").code == 0
    bare = json.loads((tmp_path / "bare" / "result.json").read_text())
    errors = [each["torque_error_percent"]["after_overall"] for each in (facts, bare)]
    assert errors[0] < errors[1]
    ran = command("evaluate", "with", "second.npz", "--json")
    assert ran.code == 0, ran.err
    ran = command("export", "with", "--to", "urdf", "--out", "files")
    assert ran.code == 0, ran.err
    assert "the law has to command them over its gains" in (
        tmp_path / "files" / "fr3.urdf"
    ).read_text().replace("\n", " ")
    for more, sentence in (
        (("--method", "wls"), "comes from an inertial prior"),
        (("--settings", "stream=true"), "in passes over rows"),
    ):
        ran = command("identify", "log.npz", *GIVEN, *more)
        assert ran.code == 2
        assert sentence in " ".join((ran.err + ran.out).split())


def test_gains_beside_a_delay(lib: Library, tmp_path: Path, command) -> None:
    """Combination: the drives' delay is 0 and the gains are those without it."""
    gain = np.linspace(0.85, 1.2, lib.n_joints)
    write_servo(lib, tmp_path / "log.npz", gain)
    ran = command("identify", "log.npz", *GIVEN, "--delay", "auto", "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert np.corrcoef(np.array(facts["friction"]["values"])[:, 4], gain)[0, 1] > 0.98
