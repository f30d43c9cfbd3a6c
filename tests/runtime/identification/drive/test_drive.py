"""Delay, encoder bias, armature and friction of drives: exact logs, intervals, refusals."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.regression.recorded_delay import _Fit, recorded_delay
from runtime.estimators.regression.samples import Samples
from runtime.identification.drive import estimate as passes
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.feedback import bias_columns
from runtime.identification.drive.result import BIAS_PRIOR, DriveFit, DriveRequest
from runtime.identification.identified import Identification
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.friction.model import DRIVE
from runtime.simulation.plant_engine import engine
from tests.runtime.conftest import Command
from tests.runtime.servo_logs import Servo, random_servo, servo_arrays

FILTERED = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.2)
EVERYTHING = DriveRequest(delay=True, bias=True)


def recorded(arrays: dict[str, np.ndarray], folder: Path) -> Recording:
    """The log read back from an NPZ without recipe."""
    logged = {key: values for key, values in arrays.items() if key != "tau_true"}
    np.savez(folder / "servo.npz", **logged)  # type: ignore[arg-type]
    return read_recording(folder / "servo.npz")


def deviations(result: Identification, servo: Servo) -> dict[str, np.ndarray]:
    """(estimate − truth)/σ of every value of the drives."""
    drive = result.drive
    sigma = result.friction_sigma
    assert drive is not None
    assert sigma is not None
    every = {
        "delay": (drive.delay - servo.delay) / drive.delay_sigma,
        "bias": (drive.bias - servo.bias) / drive.bias_sigma,
    }
    for k, name in enumerate(DRIVE):
        every[name] = (result.phi[:, k] - servo.phi[:, k]) / sigma[:, k]
    return every


def test_exact_log_gives_the_truth(
    lib: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: without noise delay, biases and friction are those of the log.

    What remains is the interpolation of the torque between rows of 5 ms: (h²/8) τ̈ of motions up to
    1.5 Hz is 3e-4 of the torque; the motion tells the biases of the two horizontal axes apart only
    by gravity, and the axis of joint 1 is vertical: its bias is not identifiable. The first
    passes take rows at ten times the cut-off, the last one all.
    """
    rates = []

    def counted(log: Recording, robot: Library, settings: Settings, **options: object):
        assert settings.preparation is not None
        rates.append(settings.preparation.rate_hz)
        return identify_recording(log, robot, settings, **options)

    monkeypatch.setattr(passes, "identify_recording", counted)
    rng = np.random.default_rng(1)
    servo = replace(random_servo(lib, rng), pi=lib.pi0)
    log = recorded(servo_arrays(lib, servo, rng, noise=1e-3), tmp_path)
    result = identify_drive(log, lib, Settings(preparation=FILTERED), EVERYTHING)
    drive = result.drive
    assert drive is not None
    assert rates[0] == 10 * FILTERED.cutoff_hz
    assert rates[-2:] == [None, None]
    assert drive.delay == pytest.approx(servo.delay, abs=2e-4)
    assert drive.bias[1:6] == pytest.approx(servo.bias[1:6], abs=2e-3)
    assert drive.verdicts()[0] == "not identifiable from this motion"
    assert set(drive.verdicts()[1:6]) == {"identified"}
    assert result.phi[:, :2] == pytest.approx(servo.phi[:, :2], rel=0.02)


def test_intervals_hold_the_truth(lib: Library, tmp_path: Path) -> None:
    """Property: of three logs with noise 95 % intervals hold the truth as often as they state.

    Groups of 21 values may miss four, and all 108 together eleven, with a probability of 2 % each.
    """
    misses = dict.fromkeys(("delay", "bias", *DRIVE), 0)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        servo = random_servo(lib, rng)
        log = recorded(servo_arrays(lib, servo, rng), tmp_path)
        result = identify_drive(log, lib, Settings(preparation=FILTERED), EVERYTHING)
        assert result.is_consistent
        for name, values in deviations(result, servo).items():
            misses[name] += int(np.sum(np.abs(values) > 1.96))
    assert max(misses.values()) <= 4
    assert sum(misses.values()) <= 11


def test_biases_of_several_logs_count_the_prior_once() -> None:
    """Closed form: a log whose σ exceeds that of the prior, by its scattered blocks, adds nothing.

    σ of a log that the prior is in: 1/σ² = 1/s² + 1/p²; of two such logs 2/s² + 1/p².
    """
    prior, own = BIAS_PRIOR, 0.01
    sharp = 1 / np.sqrt(own**-2 + prior**-2)
    empty = np.zeros(0)
    logs = [
        DriveFit(empty, empty, np.array([0.01, 0.01]), np.array([sharp, 1.2 * prior])),
        DriveFit(empty, empty, np.array([0.01, 0.01]), np.array([sharp, 1.2 * prior])),
    ]
    both = DriveFit.of_all(logs)
    assert both.bias_sigma == pytest.approx([1 / np.sqrt(2 * own**-2 + prior**-2), prior])
    assert both.bias[0] == pytest.approx(0.02 / sharp**2 * both.bias_sigma[0] ** 2)


def test_one_delay_per_joint(lib: Library, tmp_path: Path) -> None:
    """Property: different delays of the joints are found within four standard deviations."""
    rng = np.random.default_rng(3)
    servo = replace(random_servo(lib, rng), delay=np.linspace(0.01, 0.04, lib.n_joints))
    log = recorded(servo_arrays(lib, servo, rng, noise=0.02), tmp_path)
    request = DriveRequest(delay=True, per_joint=True)
    unbiased = log.replace(q=log.q + servo.bias)
    result = identify_drive(unbiased, lib, Settings(preparation=FILTERED), request)
    drive = result.drive
    assert drive is not None
    assert np.abs((drive.delay - servo.delay) / drive.delay_sigma).max() < 4
    assert len(drive.delay_parts()) == lib.n_joints


def test_delay_of_a_measured_torque(lib: Library, tmp_path: Path) -> None:
    """Property: a torque stamped 8 ms late is found; its sign is that of the stamp."""
    rng = np.random.default_rng(4)
    servo = replace(random_servo(lib, rng), delay=np.zeros(1), bias=np.zeros(lib.n_joints))
    arrays = servo_arrays(lib, servo, rng)
    t, tau = arrays["t"], arrays["tau_true"] + 0.05 * rng.normal(size=arrays["q"].shape)
    late = np.stack([np.interp(t - 0.008, t, row) for row in tau.T], axis=1)
    log = Recording(t=t, q=arrays["q"], dq=arrays["dq"], tau=late)
    settings = Settings(preparation=FILTERED, friction=Friction(DRIVE))
    drive = identify_drive(log, lib, settings, DriveRequest(delay=True)).drive
    assert drive is not None
    assert abs(drive.delay[0] - 0.008) < 4 * drive.delay_sigma[0]
    assert drive.delay_sigma[0] < 0.002


def test_friction_that_lags_is_no_delay_of_a_measured_torque(lib: Library) -> None:
    """Property: dry friction turns round within 10 mrad of travel; Coulomb columns have no memory.

    Least squares of all rows takes the lag for a further delay of 37 ms.
    """
    rng = np.random.default_rng(5)
    servo = replace(random_servo(lib, rng), delay=np.zeros(1), bias=np.zeros(lib.n_joints))
    arrays = servo_arrays(lib, servo, rng)
    t, q = arrays["t"], arrays["q"]
    state = np.zeros_like(q)
    for k, move in enumerate(np.diff(q, axis=0)):
        side = np.sign(move)
        state[k + 1] = side + (state[k] - side) * np.exp(-np.abs(move) / 0.01)
    tau = arrays["tau_true"] + np.linspace(20.0, 5.0, lib.n_joints) * state
    tau += 0.05 * rng.normal(size=q.shape)
    late = np.stack([np.interp(t - 0.008, t, row) for row in tau.T], axis=1)
    log = Recording(t=t, q=q, dq=arrays["dq"], tau=late)
    settings = Settings(preparation=FILTERED, friction=Friction(("viscous", "coulomb", "offset")))
    drive = identify_drive(log, lib, settings, DriveRequest(delay=True)).drive
    assert drive is not None
    assert abs(drive.delay[0] - 0.008) < 3 * drive.delay_sigma[0]
    assert drive.delay_sigma[0] < 0.003


@pytest.mark.parametrize(
    ("fast", "dry", "off"), [(1.0, 0.03, 0.0), (2.5, 0.03, 0.0), (2.5, 0.01, 0.1)]
)
def test_friction_that_creeps_is_no_delay_of_a_commanded_torque(
    lib: Library, tmp_path: Path, fast: float, dry: float, off: float
) -> None:
    """Oracle: MuJoCo, whose friction turns round some 10 ms before the speed, and a law 7 ms late.

    A step of 0.5 ms holds the torque, half of which counts. All rows make it 10.4 ± 0.5 ms, the
    profile by the links of the URDF 15 ms. The fast motion turns round within 0.2 s. Links that are
    10 % off the URDF leave as much as friction does near reversals: with all rows, above 7.3 ms.
    """
    rng, n, late, fine = np.random.default_rng(0), lib.n_joints, 14, 10
    size = dry * lib.limits()["effort"]
    masses = (1.0 if off else 1.05) + off * np.random.default_rng(1).normal(size=lib.n_links)
    pi = lib.pi0 * np.repeat(masses, 10)
    plant = engine(lib, pi, 0.004 * lib.limits()["effort"], step=5e-4, ranges=False)
    plant.model.dof_frictionloss[:], plant.model.dof_damping[:] = size, 0.7 * size
    t = 5e-4 * np.arange(30_000)
    w = fast * 2 * np.pi * np.array([0.1, 0.3, 0.5, 0.9])[:, None]
    phase, share = rng.uniform(0, 2 * np.pi, (2, 4, n))
    q_des = lib.home + 0.05 * fast * np.sum(
        share / w * np.sin(w * t[:, None, None] + phase), axis=1
    )
    dq_des = np.gradient(q_des, t, axis=0)
    inertia = plant.mass_diagonal(lib.home)
    kp, kd = 400 * inertia, 40 * inertia
    plant.q[:], plant.dq[:], rows, law = q_des[0], dq_des[0], [], np.zeros_like(q_des)
    for k in range(len(t)):
        rows.append((plant.q.copy(), plant.dq.copy()))
        law[k] = kp * (q_des[k] - plant.q) + kd * (dq_des[k] - plant.dq)
        plant.applied[:] = law[max(k - late, 0)]
        plant.advance()
    q, dq = np.array(rows[::fine]).swapaxes(0, 1)
    arrays = {"t": t[::fine], "q": q, "dq": dq, "q_des": q_des[::fine], "dq_des": dq_des[::fine]}
    log = recorded(arrays | {"kp": kp, "kd": kd}, tmp_path)
    result = identify_drive(log, lib, Settings(preparation=FILTERED, friction=DRIVE), EVERYTHING)
    assert result.drive is not None
    assert result.drive.delay == pytest.approx(7.25e-3, abs=3e-4)
    assert passes.SLIDES in result.notes
    low, high = recorded_delay(log, lib, FILTERED, Friction(DRIVE)).interval_s
    assert low < 7.25e-3 < high < 9e-3
    # The torque that acts as a measured one: a low-pass at 5 Hz spreads reversals over 0.2 s.
    acts = np.vstack([np.tile(law[0], (late, 1)), law[:-late]])[::fine]
    measured = Recording(t=t[::fine], q=q, dq=dq, tau=acts)
    low, high = recorded_delay(
        measured, lib, replace(FILTERED, cutoff_hz=5.0), Friction(DRIVE)
    ).interval_s
    assert -1e-3 < low < -2.5e-4 < high


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nuisance_torque_of_a_slow_motion_is_within_the_interval(lib: Library, seed: int) -> None:
    """Property: cables and friction that grows with the load leave the delay within 1.96 σ.

    Of a slow motion in much noise the residual's own slope is noise, in which nuisance torque looks
    small, and its most probable part moves the loss: 2.7, .9 and 2.7 σ without both, 1.5 at most
    with them.
    """
    rng = np.random.default_rng(seed)
    servo = replace(random_servo(lib, rng), delay=np.zeros(1), bias=np.zeros(lib.n_joints))
    arrays = servo_arrays(lib, servo, rng, fastest_hz=0.3)
    t, q = arrays["t"], arrays["q"]
    still = np.zeros_like(q)
    load = np.abs(lib.inverse_dynamics(q, still, still, lib.pi0)) * np.tanh(arrays["dq"] / 0.05)
    cable = 0.005 * lib.limits()["effort"] * rng.normal(size=lib.n_joints) * q
    tau = arrays["tau_true"] + 0.03 * load + cable + rng.normal(size=q.shape)
    late = np.stack([np.interp(t - 0.008, t, row) for row in tau.T], axis=1)
    log = Recording(t=t, q=q, dq=arrays["dq"], tau=late)
    settings = Settings(preparation=FILTERED, friction=Friction(("viscous", "coulomb", "offset")))
    drive = identify_drive(log, lib, settings, DriveRequest(delay=True)).drive
    assert drive is not None
    assert abs(drive.delay[0] - 0.008) < 1.96 * drive.delay_sigma[0]


def test_rows_without_accelerations(lib: Library, tmp_path: Path) -> None:
    """Property: momentum rows give the delay within 5 σ, and a note instead of biases."""
    rng = np.random.default_rng(10)
    servo = replace(random_servo(lib, rng), bias=np.zeros(lib.n_joints))
    log = recorded(servo_arrays(lib, servo, rng, seconds=10.0), tmp_path)
    settings = Settings(preparation=replace(FILTERED, regressor="momentum", cutoff_hz=5.0))
    result = identify_drive(log, lib, settings, EVERYTHING)
    drive = result.drive
    assert drive is not None
    assert abs(drive.delay[0] - servo.delay[0]) < 5 * drive.delay_sigma[0]
    assert set(drive.verdicts()) == {"not estimated"}
    assert any("need accelerations" in note for note in result.notes)


def test_a_slow_log_refuses_a_delay(lib: Library, tmp_path: Path) -> None:
    """Property: where the loss is flat, no delay is given, and a sentence says so."""
    rng = np.random.default_rng(5)
    # Coulomb friction would mark the instant of every reversal.
    servo = replace(random_servo(lib, rng), phi=np.zeros((lib.n_joints, len(DRIVE))))
    arrays = servo_arrays(lib, servo, rng, noise=2.0, fastest_hz=0.101, seconds=8.0)
    log = recorded(arrays, tmp_path)
    result = identify_drive(log, lib, Settings(preparation=FILTERED), DriveRequest(delay=True))
    assert result.drive is not None
    assert result.drive.delay_parts() is None
    assert any("does not determine a delay" in note for note in result.notes)


def test_rows_without_the_torque_of_every_delay_are_left_out(lib: Library) -> None:
    """Oracle: of 169 rows at 100 Hz 20 go to each end of the filter, then 15 to 145 ms."""
    t = np.arange(169) / 100.0
    q = np.sin(np.outer(t, np.arange(1.0, 8.0)))
    log = Recording(t, q, np.gradient(q, t, axis=0), tau=q)
    with pytest.raises(IdentificationError, match=r"expected 100 rows .* got 99"):
        recorded_delay(log, lib, FILTERED, Friction(("viscous",)), 0.145)


def test_armature_is_not_negative(lib: Library, tmp_path: Path) -> None:
    """Property: a torque that asks for a negative rotor gets none, and the reason is noted."""
    rng = np.random.default_rng(6)
    servo = random_servo(lib, rng)
    phi = servo.phi.copy()
    phi[3, 3] = -0.3
    servo = replace(servo, phi=phi, delay=np.zeros(1), bias=np.zeros(lib.n_joints))
    log = recorded(servo_arrays(lib, servo, rng), tmp_path)
    result = identify_drive(log, lib, Settings(preparation=FILTERED), DriveRequest())
    assert result.phi[3, 3] == 0.0
    assert any("rotor of fr3_joint4" in note for note in result.notes)


def test_bias_columns_are_derivatives(lib: Library) -> None:
    """Derivative: the Taylor remainder of Y(q + h b) π falls with h²."""
    rng = np.random.default_rng(7)
    q, dq, ddq = rng.normal(size=(3, 5, lib.n_joints))
    samples = Samples(q, dq, ddq, q, np.zeros((5, lib.n_joints, 0)))
    b = rng.normal(size=lib.n_joints)
    columns = bias_columns(lib, samples, lib.pi0)
    remainders = [
        np.abs(
            lib.inverse_dynamics(q + h * b, dq, ddq, lib.pi0)
            - lib.inverse_dynamics(q, dq, ddq, lib.pi0)
            - h * columns @ b
        ).max()
        for h in (1e-2, 5e-3)
    ]
    assert remainders[0] / remainders[1] == pytest.approx(4.0, rel=0.1)


def test_other_methods_are_refused(lib: Library, tmp_path: Path) -> None:
    """Property: one sentence that names the method."""
    rng = np.random.default_rng(8)
    log = recorded(servo_arrays(lib, random_servo(lib, rng), rng, seconds=2), tmp_path)
    with pytest.raises(IdentificationError, match="got ols"):
        identify_drive(log, lib, Settings(method="ols"), EVERYTHING)


def test_identify_writes_the_drives(lib: Library, tmp_path: Path, command: Command) -> None:
    """Property: result.json of the command has delay, source and one drive per joint."""
    rng = np.random.default_rng(9)
    servo = random_servo(lib, rng)
    recorded(servo_arrays(lib, servo, rng), tmp_path)
    words = ("--cutoff", "10", "--delay", "auto", "--out", tmp_path / "out")
    command("identify", tmp_path / "servo.npz", "--robot", lib.folder, *words)
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["torque_source"] == "commanded"
    assert abs(facts["delay_s"]["value"] - servo.delay[0]) < 5 * facts["delay_s"]["sigma"]
    keys = {"joint", "armature", "viscous", "coulomb", "offset", "encoder_bias", "sigma"}
    assert [keys <= set(drive) for drive in facts["drive"]] == [True] * lib.n_joints
    assert set(facts["drive"][0]["sigma"]) == keys - {"joint", "sigma"}
    assert any("commanded by a control law" in warning for warning in facts["warnings"])


def test_every_log_has_a_delay_of_its_own(lib: Library, command: Command, tmp_path: Path) -> None:
    """Oracle: two logs of one robot whose torques act 12 and 31 ms late; both are recovered.

    The delays err by the interpolation of the torque between rows of 5 ms and by the noise.
    """
    rng = np.random.default_rng(3)
    first = replace(random_servo(lib, rng), pi=lib.pi0, bias=np.zeros(lib.n_joints))
    for name, late in (("a", 0.012), ("b", 0.031)):
        arrays = servo_arrays(
            lib, replace(first, delay=np.array([late])), rng, noise=1e-2, seconds=8.0
        )
        logged = {key: values for key, values in arrays.items() if key != "tau_true"}
        np.savez(tmp_path / f"{name}.npz", **logged)  # type: ignore[arg-type]
    words = ("--robot", lib.folder, "--cutoff", 10, "--delay", "auto", "--settings", "report=false")
    ran = command("identify", "a.npz", "b.npz", *words, "--out", "out", "--verbose")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out/result.json").read_text())
    delays = facts["sessions"]["delay_s"]
    assert [each["name"] for each in delays] == ["a", "b"]
    assert delays[0]["value"] == pytest.approx(0.012, abs=5e-4)
    assert delays[1]["value"] == pytest.approx(0.031, abs=5e-4)
    assert "b: delay of the torque 3" in ran.out
    assert "prepared in another way" not in ran.out
    # With both delays taken out the logs agree: the residual is that of the noise.
    assert facts["torque_error_percent"]["after_overall"] < 1.0


def test_thinned_rows_end_within_a_deviation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: passes on thinned rows end at a step below σ, and all rows state the result.

    The toy has its minimum at 1.2 by thinned rows and at 1.0 by all; every step halves the rest.
    """
    usual, seen = Preparation(filter="butterworth", cutoff_hz=10.0), []

    class Toy:
        preparation = usual
        counts = (1,)
        recording = SimpleNamespace(rate_hz=1000.0)

        def rough(self, preparation: Preparation = usual) -> SimpleNamespace:
            return SimpleNamespace(preparation=preparation)

    def linearised_at(_: Toy, present: Preparation, x: np.ndarray, rough: bool) -> SimpleNamespace:
        end, sigma = (1.0, 0.01) if present is usual else (1.2, 0.2)
        seen.append((present.rate_hz, abs(end - x[0]) / 2 / sigma))
        return SimpleNamespace(step=(end - x) / 2, sigma=np.array([sigma]))

    monkeypatch.setattr(passes, "identification_at", lambda present, x: present.preparation)
    monkeypatch.setattr(passes, "linearised_at", linearised_at)
    monkeypatch.setattr(passes, "MOST_STEP", (np.inf,))
    x, sigma = passes.newton_passes(Toy(), np.array([0.6]))  # type: ignore[arg-type]
    assert [rate for rate, _ in seen] == [100.0] * 2 + [None] * 4
    for rate in (190.0, 189.0):  # rows are left out where the log is nearly twice as fast
        slow = passes._thinned(SimpleNamespace(rate_hz=rate), usual)  # type: ignore[arg-type]
        assert (slow is usual) == (rate < 190)
    assert [size <= 1.0 for _, size in seen][:2] == [False, True]
    assert len(seen) == passes.PASSES
    assert sigma[0] == 0.01
    assert x[0] == pytest.approx(1.0, abs=0.005)


def test_the_joint_with_the_least_noise_determines_the_delay(double: Library) -> None:
    """Oracle: σ² = s² / Σ ẇ² of a torque w that is known up to its size, s the noise of that joint.

    The size is that of both joints; by the noise of the other one, of 0.5, its torque alone would
    be wrong by six times s.
    """
    t, late, least, rng = np.arange(2000) / 100.0, 0.013, 1e-3, np.random.default_rng(5)
    omega = 2 * np.pi * np.array([0.5, 0.8, 1.1])
    noise = np.array([least, 0.5]) * rng.normal(size=(len(t), 2))

    def torque(delay: float) -> np.ndarray:
        return np.sin(np.outer(t + delay, omega)).sum(axis=1)[:, None] + noise

    rows = np.sin(np.outer(t + late, omega)).sum(axis=1)[:, None, None] * np.ones((1, 2, 1))
    rate = (omega * np.cos(np.outer(t + late, omega))).sum(axis=1)
    expected = least / np.linalg.norm(rate)
    samples = Samples(
        rows[..., 0], rate[:, None] * np.ones(2), None, 0 * noise, np.zeros((2000, 2, 0))
    )
    slopes = rate[:, None, None] * np.ones((1, 2, 1)) * [1.0, 0.0]
    fit = _Fit(double, samples, rows, slopes, torque, 0.0, np.ones((2000, 2)))
    delays = late + expected * np.linspace(-8, 8, 81)
    profile = fit.profile(delays, fit.solved(delays))
    assert abs(profile.best - late) < 4 * expected
    assert profile.sigma == pytest.approx(expected, rel=0.3)
