"""Torque noise that the control law turns into motion: the loop, and estimates without bias."""

from pathlib import Path

import numpy as np
import pytest

from runtime.estimators.convex.entropic_prior import CAD
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.drive import feedback
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.feedback import FEEDBACK, linearised, response
from runtime.identification.drive.result import DriveRequest
from runtime.identification.settings import Settings
from runtime.library import Array, Library, load
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.recipes.recipe import ControlLaw
from runtime.recording.settings import JointMotion

STEP, LOGGED, SECONDS = 1e-3, 5, 20.0
KP, KD, EPSILON = 20.0, 1.0, 0.02
DELAY, PHI = 0.020, np.array([1.5, 0.6, 0.0, 0.1])
FREE = np.full(1, np.inf)  # prior of a delay


def test_response_is_that_of_the_transfer_function() -> None:
    """Oracle: after the transient, δ(t) = Re[w e^{jωt} / (−Jω² + jωs + (kp + jω kd) e^{−jωd})].

    The trapezoidal rule at ω h = 0.06 has a phase error of (ω h)²/12 = 3e-4 per radian; linear
    interpolation of the late state errs by (ω h)²/8 = 5e-4, both raised by the resonance.
    """
    t = np.arange(0.0, 20.0, 0.005)
    omega, delay = 12.0, np.array([0.0, 0.0123, 0.040])
    inertia, slope = np.array([0.5, 0.3, 0.4]), np.array([0.2, 3.0, 6.0])
    kp, kd = np.full(3, 40.0), np.full(3, 1.0)
    ones = np.ones((len(t), 3))
    noise = np.cos(omega * t)[:, None] * ones
    moves = response(t, noise, inertia * ones, slope * ones, (kp, kd), delay)
    late = np.exp(-1j * omega * delay)
    gain = 1 / (-inertia * omega**2 + 1j * omega * slope + (kp + 1j * omega * kd) * late)
    for k, each in enumerate(moves):
        expected = np.real((1j * omega) ** k * gain * np.exp(1j * omega * t)[:, None])
        error = (each - expected)[-400:-2] / (np.abs(gain) * omega**k)
        assert np.abs(error).max() < 5e-3


def test_one_instant_does_not_respond() -> None:
    """Property: a stretch of one row has no time in which noise could move a joint."""
    one, gains = np.ones((1, 2)), (np.ones(2), np.ones(2))
    assert not response(np.zeros(1), one, one, one, gains, np.zeros(2)).any()


@pytest.fixture(scope="module")
def pendulum(tiny_built: Path) -> Library:
    """One joint, whose loop is integrated in no time."""
    return load(tiny_built)


def noisy_loops(lib: Library, logs: int, noise: float) -> dict[str, Array]:
    """Logs of a pendulum with torque noise under a late PD law, integrated together.

    Args:
        lib: library of the pendulum.
        logs: number of them.
        noise: standard deviation of the torque per step [N·m].

    Returns:
        t, and q, dq, q_des of all logs, (rows, logs) [rad].
    """
    rng = np.random.default_rng(0)
    t = np.arange(0.0, SECONDS, STEP)
    start = rng.uniform(0, 2 * np.pi, size=logs)
    q_des = 0.5 * np.sin(2 * np.pi * (0.1 * t + 0.045 * t**2)[:, None] + start)
    zero, one = np.zeros((1, 1)), np.ones((1, 1))
    inertia = float(lib.inverse_dynamics(zero, zero, one, lib.pi0)[0, 0])
    inertia -= float(lib.inverse_dynamics(zero, zero, zero, lib.pi0)[0, 0])
    q, v, commanded = q_des[0].copy(), np.zeros(logs), np.zeros_like(q_des)
    rows: dict[str, list[Array]] = {"q": [], "dq": []}
    late = round(DELAY / STEP)
    for k in range(len(t)):
        if k % LOGGED == 0:
            rows["q"].append(q)
            rows["dq"].append(v)
        commanded[k] = KP * (q_des[k] - q) - KD * v
        torque = commanded[max(k - late, 0)] + noise * rng.normal(size=logs)
        sign = np.tanh(v / EPSILON)
        still = lib.inverse_dynamics(q[:, None], 0 * q[:, None], 0 * q[:, None], lib.pi0)[:, 0]
        slope = PHI[0] + PHI[1] * (1 - sign**2) / EPSILON
        force = torque - still - PHI[0] * v - PHI[1] * sign
        change = STEP * force / (inertia + PHI[3] + STEP / 2 * slope)
        q, v = q + STEP * (v + change / 2), v + change
    logged = {key: np.array(values) for key, values in rows.items()}
    return {"t": t[::LOGGED], "q_des": q_des[::LOGGED], **logged}


def test_noise_in_the_loop_gives_no_bias(
    pendulum: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: over 8 logs delay, friction and rotor have no mean error; least squares has one.

    The mean of 8 errors in units of σ has a standard deviation of 0.35: 1.06 is three of them.
    """
    logs = noisy_loops(pendulum, 8, noise=0.35)
    settings = Settings(
        preparation=Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.3), gain_sigma=0
    )
    means = {}
    for name in ("corrected", "least squares"):
        if name == "least squares":
            monkeypatch.setattr(feedback, "feedback_torque", lambda *_: None)
        errors = []
        for i in range(8):
            arrays = {key: x if key == "t" else x[:, i : i + 1] for key, x in logs.items()}
            path = tmp_path / "log.npz"
            np.savez(path, kp=[KP], kd=[KD], **arrays)  # type: ignore[arg-type]
            result = identify_drive(
                read_recording(path), pendulum, settings, DriveRequest(delay=True)
            )
            assert (FEEDBACK in result.train.history) == (name == "corrected")
            drive = result.drive
            assert drive is not None
            late = np.append(drive.delay - DELAY - STEP / 2, result.phi[0] - PHI)
            errors.append(late / np.append(drive.delay_sigma, result.friction_sigma[0]))
        means[name] = np.mean(errors, axis=0)
    assert np.abs(means["corrected"]).max() < 1.06
    assert means["least squares"][0] > 1.5


def test_a_loop_that_is_not_that_of_the_model_corrects_the_delay_alone(
    pendulum: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the delay has no bias, its σ contains the step, and links keep their rows.

    Least squares is 1.2 σ late; 20 % for the noise that the two fits leave.
    """
    monkeypatch.setattr(feedback, "has_memory", lambda _: True)
    logs = noisy_loops(pendulum, 1, noise=0.35)
    np.savez(tmp_path / "log.npz", kp=[KP], kd=[KD], **logs)  # type: ignore[arg-type]
    steps = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.3)
    settings = Settings(preparation=steps, gain_sigma=0)
    recording = read_recording(tmp_path / "log.npz")
    result = identify_drive(recording, pendulum, settings, DriveRequest(delay=True))
    monkeypatch.setattr(feedback, "feedback_torque", lambda *_: None)
    biased = identify_drive(recording, pendulum, settings, DriveRequest(delay=True)).drive
    assert result.drive is not None
    assert biased is not None
    step = abs(result.drive.delay - biased.delay)
    assert FEEDBACK not in result.train.history
    assert abs(result.drive.delay - DELAY - STEP / 2) < biased.delay_sigma
    assert abs(biased.delay - DELAY - STEP / 2) > biased.delay_sigma
    assert result.drive.delay_sigma == pytest.approx(np.hypot(step, biased.delay_sigma), rel=0.2)


def test_stretches_of_a_long_log_hold_its_information(
    pendulum: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: σ from a quarter of the rows, in stretches, is in the mean that of all rows.

    The motion of a stretch differs from that of the log; without the rows between the stretches σ
    would be twice as large.
    """
    logs = noisy_loops(pendulum, 1, noise=0.35)
    np.savez(tmp_path / "log.npz", kp=[KP], kd=[KD], **logs)  # type: ignore[arg-type]
    recording = read_recording(tmp_path / "log.npz")
    settings = Settings(
        preparation=Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.3), gain_sigma=0
    )
    request = DriveRequest(delay=True)
    result = identify_drive(recording, pendulum, settings, request)
    sigmas = []
    for most in (feedback.MOST_ROWS, len(result.train) // 4):
        monkeypatch.setattr(feedback, "MOST_ROWS", most)
        step = linearised(result, request, x=np.zeros(1), spread=FREE, kappa=CAD)
        sigmas.append(np.append(step.sigma, step.phi_sigma))
    ratio = np.exp(np.mean(np.log(sigmas[1] / sigmas[0])))
    assert ratio == pytest.approx(1.0, rel=0.3)
    monkeypatch.undo()
    # Oracle: the variance of φ is that at known delay and what the delay moves; S of one column
    # more differs by less than 5 %. The links of the result have the columns of the delay, too. The
    # scatter of blocks widens the delay alone and is left out.
    monkeypatch.setattr(feedback, "_widening", lambda *given: np.ones(len(given[2])))
    step, alone = (
        linearised(result, each, x=np.zeros_like(free), spread=free, kappa=CAD)
        for each, free in ((request, FREE), (DriveRequest(), FREE[:0]))
    )
    moved = np.sum(step.phi_moved**2, axis=1).reshape(step.phi_sigma.shape)
    assert step.phi_sigma**2 == pytest.approx(alone.phi_sigma**2 + moved, rel=0.05)
    assert (moved / alone.phi_sigma**2).max() > 0.5
    monkeypatch.undo()
    step = linearised(result, request, x=np.zeros(1), spread=FREE, kappa=CAD)
    assert result.uncertainty is not None
    columns = result.uncertainty.root.T.tolist()
    assert any(each == pytest.approx(step.pi_moved[:, 0], rel=1e-9) for each in columns)


def test_gains_of_a_motor_act_on_the_joint_with_the_square_of_the_gear() -> None:
    """Oracle: τ = r τ_m, θ = r q, τ_m = kp (θ_des − θ) − kd dθ, hence τ = r² (kp (q_des − q) …)."""
    law = ControlLaw("pd", q_des="q_des", kp=2.0, kd=(0.5, 0.25), gear=(10.0, 20.0))
    gains = feedback._gains(law, 2)
    assert gains is not None
    assert [each.tolist() for each in gains] == [[200.0, 800.0], [50.0, 100.0]]


def test_the_loop_has_the_slope_of_friction(pendulum: Library) -> None:
    """Oracle: d/dq̇ of viscous friction and of c tanh(q̇/ε); the difference errs by (h/ε)² < 1e-4."""
    terms = Friction(("viscous", "coulomb", "offset"), EPSILON)
    dq = np.linspace(-0.05, 0.05, 9)[:, None]
    at = Recording(np.arange(9) * 0.01, 0 * dq, dq, 0 * dq, 0 * dq)
    phi = np.array([[0.7, 0.4, 5.0]])
    _, slope = feedback._loop(samples_of(at, pendulum), pendulum, pendulum.pi0, phi, terms)
    expected = 0.7 + 0.4 / EPSILON / np.cosh(dq / EPSILON) ** 2
    np.testing.assert_allclose(slope, expected, rtol=1e-4)
    # What falls with the speed would drive the loop: it counts as none.
    _, slope = feedback._loop(samples_of(at, pendulum), pendulum, pendulum.pi0, -phi, terms)
    assert not slope.any()


def test_samples_of_another_motion(pendulum: Library) -> None:
    """Oracle: the samples of a log of that motion; a column that was left out stays so."""
    terms = Friction(("viscous", "coulomb", "rotor"), EPSILON)
    q, dq, ddq, tau, *moves = np.random.default_rng(0).normal(size=(7, 9, 1))
    there = feedback.columns(
        JointMotion(dq + moves[1], q + moves[0], ddq + moves[2], pendulum), terms
    )
    here = feedback.columns(JointMotion(dq, q, ddq, pendulum), terms)
    here[..., 1] = there[..., 1] = 0.0
    samples = Samples(q, dq, ddq, tau, here)
    found = feedback._moved(samples, np.stack(moves), pendulum, terms)
    np.testing.assert_array_equal(found.q, q + moves[0])
    np.testing.assert_array_equal(found.dq, dq + moves[1])
    np.testing.assert_array_equal(found.ddq, ddq + moves[2])
    np.testing.assert_allclose(found.columns, there, atol=1e-12)
    assert np.abs(found.columns - here).max() > 0.1


def test_rough_rows_are_evenly_spread() -> None:
    """Oracle: every third of 2000 rows, from the first on."""
    assert feedback._taken(2000, True).tolist() == list(range(0, 2000, 3))
