"""Contradictions of data, prior and result are named before any statement of trust.

Oracle: simulated logs whose fault is known; clean ones have none.
"""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from runtime import identify, read_recording
from runtime.estimators import uncertainty
from runtime.estimators.convex.entropic_prior import bodies_of
from runtime.estimators.convex.newton import Constraints
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.regression.causes import GAIN, ZERO, Cause
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import uncertainty_of
from runtime.excitation import Trajectory
from runtime.identification.comparison.output import advise
from runtime.identification.comparison.run import compare
from runtime.identification.drive.estimate import identify_drive
from runtime.identification.drive.result import DriveRequest
from runtime.identification.problem_setup import assemble
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.columns import dahl_state
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed

TERMS = Friction(("viscous", "coulomb", "offset"), 0.03)
FILTERED = Preparation(filter="butterworth", cutoff_hz=8.0)
TRUST = "predicted torques of similar motions hold"


def body(lib: Library, mass: float, centre: np.ndarray) -> np.ndarray:
    """π of a ball of 5 cm with its centre in the frame of a link."""
    moments = np.zeros((4, 4))
    moments[:3, :3] = 0.2 * mass * 0.05**2 * np.eye(3) + mass * np.outer(centre, centre)
    moments[:3, 3] = moments[3, :3] = mass * centre
    moments[3, 3] = mass
    basis = bodies_of(lib).basis.reshape(10, 16)
    return np.linalg.lstsq(basis.T, moments.ravel(), rcond=None)[0]


def logged(lib: Library, motion: Trajectory, seed: int, payload: float = 0.0) -> Recording:
    """A log of the robot of the URDF with friction and 0.05 N·m of noise."""
    rng, pi = np.random.default_rng(seed), lib.pi0.copy()
    if payload:
        pi[-10:] += body(lib, payload, np.array([0.0, 0.0, 0.157]) + 0.02 * rng.normal(size=3))
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    return ideal(lib, motion, plant, rng=rng)


def advice(recording: Recording, lib: Library, method: str = "map") -> str:
    result = identify_recording(recording, lib, method, friction=TERMS, preparation=FILTERED)
    assert result.uncertainty is not None
    return result.uncertainty.advice()


@pytest.mark.parametrize("seed", range(4))
def test_clean_logs_raise_no_alarm(lib, trajectories, seed):
    """Property: of a right prior and right torques nothing is doubted; 10 of 10 were clean."""
    words = advice(logged(lib, trajectories[seed % 3], seed), lib)
    assert words.startswith("the residuals look independent beyond the low-pass filter")
    assert TRUST in words


@pytest.mark.parametrize("payload", [0.5, 3.0])
@pytest.mark.parametrize("method", ["map", "pc-ols"])
def test_an_unknown_payload_is_named(lib, trajectories, payload, method):
    """Oracle: a body in the hand that the URDF lacks; the link, and that the URDF is wrong."""
    words = advice(logged(lib, trajectories[0], 1, payload), lib, method)
    assert TRUST not in words
    assert "contradict the inertia of" in words
    # A body on the axis of joint 7 has the same base parameters on link 6.
    assert "contradict the inertia of fr3_link7" in words or "of fr3_link6" in words
    assert "the URDF is wrong rather than the log" in words


def test_compare_doubts_what_identify_doubts(lib, trajectories):
    """Oracle: a gain of 1.1; of a clean log, and of 3 kg in the hand, nothing is doubted."""
    cases = ((0.0, 1.0, False), (3.0, 1.0, False), (0.0, 1.1, True))
    for payload, gain, is_doubted in cases:
        log = logged(lib, trajectories[0], 1, payload)
        log = log.replace(tau=log.tau * np.where(np.arange(7) == 1, gain, 1.0))
        assembly = assemble(log, lib, friction=TERMS, preparation=FILTERED)
        rows = compare(assembly, ["pc-ols"]).rows
        sentences = advise(rows, len(lib.base_columns)).sentences
        assert any(s.startswith("Do not trust it") for s in sentences) == is_doubted
        assert any("the torque is wrong rather than the URDF" in s for s in sentences) == is_doubted


def test_a_unit_that_differs_from_its_fleet_is_named(lib, trajectories):
    """Oracle: 3 kg in the hand; the prior of the fleet is doubted instead of the URDF."""
    log = logged(lib, trajectories[0], 1, 3.0)
    prior = PriorFile(kappa=2500.0, constraints=Constraints((), ()), centre=lib.pi0, units=5)
    result = identify_recording(log, lib, friction=TERMS, preparation=FILTERED, prior=prior)
    words = result.uncertainty.advice()
    assert "kg in the prior of the fleet, " in words
    assert "this unit differs from its fleet" in words
    assert "URDF" not in words


def test_small_unknown_payloads_are_named(lib, trajectories):
    """Oracle: 0.5 kg in the hand on three motions; the test of all links together saw 11 of 12."""
    words = [advice(logged(lib, trajectories[k % 3], k, 0.5), lib) for k in range(12)]
    # 50 of 50 are named with the robot of the URDF, 48 of 50 with robots 10 % off.
    assert all("contradict the inertia" in w for w in words)


def test_a_heavy_payload_on_another_robot_is_named_with_its_mass(lib, trajectories):
    """Oracle: 3 kg on a robot 10 % off its URDF, where Newton's method alone fails."""
    rng = np.random.default_rng([4, 11])
    pi = perturbed(lib, lib.pi0, 0.1, rng)
    pi[-10:] += body(lib, 3.0, np.array([0.0, 0.0, 0.15]) + 0.02 * rng.normal(size=3))
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    log = ideal(lib, trajectories[1], plant, rng=rng)
    result = identify_recording(log, lib, friction=TERMS, preparation=FILTERED)
    assert result.status.startswith("converged")
    words = result.uncertainty.advice()
    assert "contradict the inertia of fr3_link7 (0.627 kg in the URDF" in words
    # The mass of a link is known to the prior of the others, 25 % of 1.8 kg of link 6.
    mass = float(words.split("kg in the URDF, ")[1].split()[0])
    assert mass == pytest.approx(pi[60], abs=0.5)


def test_a_mass_that_the_data_leave_open_is_not_stated(lib, trajectories):
    """Property: a body on link 2, where σ of the released mass is 50 kg, is named without mass."""
    pi = lib.pi0.copy()
    pi[10:20] += body(lib, 6.0, np.array([0.15, 0.05, -0.1]))
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    log = ideal(lib, trajectories[0], plant, rng=np.random.default_rng(3))
    words = advice(log, lib)
    assert "contradict the inertia of fr3_link2" in words
    assert "kg" not in words.split("while the joints agree")[0], words


@pytest.mark.parametrize("seed", range(3))
def test_robots_within_the_prior_raise_no_alarm(lib, trajectories, seed):
    """Property: 20 % off the URDF in every direction is what the prior of 25 % allows."""
    rng = np.random.default_rng(seed)
    pi = perturbed(lib, lib.pi0, 0.2, rng)
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    assert "do not trust" not in advice(ideal(lib, trajectories[seed], plant, rng=rng), lib)


@pytest.mark.parametrize(
    ("factor", "assumed"), [(1e3, "given mass"), (1e-3, "given mass"), (1e-3, "placeholder")]
)
def test_a_wrong_unit_of_torque_is_named(lib, trajectories, monkeypatch, factor, assumed):
    """Oracle: torque in mN·m, or a thousandth; the torque is wrong, not the URDF. Placeholders for
    links without inertials are not compared with it.
    """
    facts = replace(lib.manifest, assumed=dict.fromkeys(lib.link_names, assumed))
    monkeypatch.setattr(lib, "manifest", facts)
    log = logged(lib, trajectories[0], 0)
    known = assumed == "given mass"
    words = advice(log.replace(tau=factor * log.tau), lib, "map" if known else "pc-ols")
    assert known == ("the unit or sign of the torque is wrong rather than the URDF" in words)
    assert known != (TRUST in words)


def test_a_torque_that_no_factor_explains_has_no_wrong_unit(lib, trajectories):
    """Property: without the gravity torque, the rest is no multiple of that of the URDF."""
    log = logged(lib, trajectories[0], 0)
    still = np.zeros_like(log.q)
    falls = lib.inverse_dynamics(log.q, still, still, lib.pi0)
    words = advice(log.replace(tau=log.tau - falls), lib)
    assert "does not follow that of the URDF" in words
    assert "gravity compensation" in words
    assert "unit or sign" not in words
    assert TRUST not in words


def test_a_wrong_torque_gain_is_named(lib, trajectories):
    """Oracle: joint 6 reads 10 % too much; the gain is known to 2 % of 480 filtered samples."""
    log = logged(lib, trajectories[0], 0)
    words = advice(log.replace(tau=log.tau * np.where(np.arange(7) == 5, 1.1, 1.0)), lib)
    assert TRUST not in words
    assert "at fr3_joint6" in words
    assert 1.07 < float(words.split("torque gain of ")[1].split()[0]) < 1.13


def test_a_gain_that_the_log_cannot_show_is_stated(lib, trajectories):
    """Oracle: 10 % at joint 7, whose torque is friction; σ of its gain is 6 to 9 % of such logs."""
    log = logged(lib, trajectories[0], 0)
    wrong = log.replace(tau=log.tau * np.where(np.arange(7) == 6, 1.1, 1.0))
    result = identify_recording(wrong, lib, friction=TERMS, preparation=FILTERED)
    assert "may not show a wrong torque gain of fr3_joint7 (up to" in result.uncertainty.advice()
    limits = result.uncertainty.tests.causes.limits(GAIN)
    # The joints that carry links are seen at 6 % and less.
    assert (limits[:6] < 0.06).all()
    assert limits[6] > 0.1


@pytest.mark.parametrize("seed", range(2))
def test_a_gain_of_a_wrist_is_named_by_a_longer_log(lib, trajectories, seed):
    """Oracle: 10 % at joint 7; noise of 0.015 N·m stands for eleven times as many rows.

    σ of its gain is 2 %, so that 10 % are 5 σ: beyond the quantile of one joint, 3.8 σ, and not
    beyond that of all joints with its margin, 6.7 σ.
    """
    rng = np.random.default_rng(seed)
    plant = Plant(lib.pi0, viscous=0.5, coulomb=0.3, torque_noise=0.015)
    log = ideal(lib, trajectories[0], plant, rng=rng)
    assert "at fr3_joint" not in advice(log, lib)
    words = advice(log.replace(tau=log.tau * np.where(np.arange(7) == 6, 1.1, 1.0)), lib)
    assert "mostly by a torque gain of 1." in words
    assert "at fr3_joint7, relative to the other joints" in words


def test_a_gain_is_distinguished_from_friction(lib, trajectories):
    """Oracle: 3.8 % at joint 5, whose torque looks like friction that grows with the load, too."""
    log = logged(lib, trajectories[0], 2)
    words = advice(log.replace(tau=log.tau * np.where(np.arange(7) == 4, 1.038, 1.0)), lib)
    assert "at fr3_joint5, relative to the other joints" in words


@pytest.mark.parametrize("seed", range(2))
def test_friction_without_a_column_is_no_gain(lib, trajectories, seed):
    """Property: a Stribeck peak of all joints is named as friction alone."""
    words = advice(gripping(logged(lib, trajectories[0], seed), tuple(range(7))), lib)
    assert "contain friction" in words
    assert "a torque gain of" not in words


@pytest.mark.parametrize("seed", range(3))
def test_gains_at_their_limits_are_noticed(lib, trajectories, seed):
    """Property: a gain of joint 5 that is off by its limit is significant in 95 of 100 logs."""
    log = logged(lib, trajectories[0], seed)

    def tests(recording):
        return identify_recording(
            recording, lib, friction=TERMS, preparation=FILTERED
        ).uncertainty.tests

    limit = tests(log).causes.limits(GAIN)[4]
    assert 0 < limit < 0.06
    wrong = tests(log.replace(tau=log.tau * np.where(np.arange(7) == 4, 1 + limit, 1.0)))
    assert any("at fr3_joint5" in text for text in wrong.contradictions + wrong.model_errors)


def test_small_errors_of_gains_make_intervals_too_narrow(lib, trajectories):
    """Oracle: 2 % at joint 2, known to 0.1 %; the result is usable, its intervals are not."""
    log = logged(lib, trajectories[0], 0)
    words = advice(log.replace(tau=log.tau * np.where(np.arange(7) == 1, 1.02, 1.0)), lib)
    assert "do not trust" not in words
    assert "a torque gain of 1.0" in words
    assert "at fr3_joint2" in words
    assert "intervals are too narrow" in words


def test_a_contradiction_that_no_gain_explains_is_no_gain(lib, trajectories):
    """Oracle: torques of joints 2 and 4 exchanged; the best gain, −0.3, is no torque constant."""
    log = logged(lib, trajectories[0], 0)
    words = advice(log.replace(tau=log.tau[:, [0, 3, 2, 1, 4, 5, 6]]), lib)
    assert "do not trust" in words
    assert "a torque gain of" not in words
    assert "no torque gain explains it" in words
    assert "the torques of fr3_joint2, fr3_joint4 are exchanged" in words


def test_an_angle_of_several_turns_is_no_encoder_zero():
    """Property: the column is a derivative at angle 0; residuals of friction gave −3600°."""
    assert Cause(ZERO, 0, 0.6, 0.1, 0.5, 100.0, 10.0).is_plausible
    assert not Cause(ZERO, 0, -63.0, 14.0, 0.5, 100.0, 10.0).is_plausible


def test_a_tilt_of_the_base_is_named_with_its_gravity(lib, trajectories):
    """Oracle: Pinocchio's torque of gravity that is turned by 2°; σ of the tilt is 0.05°."""
    log = logged(lib, trajectories[0], 0)
    model = pinocchio.buildModelFromUrdf(str(lib.folder / "fr3.urdf"))
    level = torque_of_gravity(model, log.q)
    model.gravity.linear = pinocchio.exp3(np.radians([2.0, 0, 0])) @ model.gravity.linear
    words = advice(log.replace(tau=log.tau + torque_of_gravity(model, log.q) - level), lib)
    assert TRUST not in words
    tilt = float(words.split("a base that is tilted by ")[1].split()[0])
    assert tilt == pytest.approx(2.0, abs=0.3)
    gravity = [float(x) for x in words.split("--gravity=")[1].split(";")[0].split(",")]
    assert gravity == pytest.approx(list(model.gravity.linear), abs=0.05)


SHORT = (slice(0, 350), slice(328, 828), slice(369, 869), slice(378, 728))
"""Cuts of the bundled log that named gains, tilts of 6 to 25° and an encoder zero of 11°: noise of
accelerations entered columns and residual alike."""


@pytest.mark.parametrize("rows", SHORT)
def test_short_cuts_of_a_clean_log_are_not_doubted(lib, rows):
    """Property: 3.5 to 5 s, of which the training takes 60 %, name no cause."""
    log = read_recording("fr3_simulated").take(rows, "cut")
    assert identify(log, lib).uncertainty.contradictions == ()


@pytest.mark.parametrize("rows", SHORT[1:3])
def test_a_tilt_is_named_by_a_short_cut(lib, rows):
    """Oracle: Pinocchio's torque of gravity turned by 10°; σ of the tilt is 1.2 and 2.2°."""
    log = read_recording("fr3_simulated").take(rows, "cut")
    model = pinocchio.buildModelFromUrdf(str(lib.folder / "fr3.urdf"))
    level = torque_of_gravity(model, log.q)
    model.gravity.linear = pinocchio.exp3(np.radians([0.0, 10.0, 0.0])) @ model.gravity.linear
    tilted = log.replace(tau=log.tau + torque_of_gravity(model, log.q) - level)
    (doubt,) = identify(tilted, lib).uncertainty.contradictions
    assert float(doubt.split("tilted by ")[1].split()[0]) == pytest.approx(10.0, abs=2.0)


def test_a_log_too_short_to_tell_says_so(lib):
    """Property: 1.5 s of training leave no estimate of the noise beside 88 unknowns."""
    log = read_recording("fr3_simulated").take(slice(434, 685), "cut")
    words = identify(log, lib).uncertainty.advice()
    assert "may not show a wrong torque gain of fr3_joint1 (of any size), fr3_joint2 (of" in words
    assert "do not trust" not in words


def torque_of_gravity(model, q: np.ndarray) -> np.ndarray:
    """Gravity torque of poses (N, n) by Pinocchio."""
    data = model.createData()
    return np.array([pinocchio.computeGeneralizedGravity(model, data, row) for row in q])


@pytest.mark.parametrize("joint", [1, 3])
def test_an_encoder_zero_is_named_with_its_size(lib, trajectories, joint):
    """Oracle: a joint that reads 1° too much; a clean log states from which size on it is seen."""
    log = logged(lib, trajectories[0], 0)
    clean = advice(log, lib)
    assert "this log shows a tilt of the base from 0.1" in clean
    assert float(clean.split(f"fr3_joint{joint + 1} from ")[1].split("°")[0]) < 1.0
    assert "and that of 3 other joints at no angle below 10°" in clean
    words = advice(log.replace(q=log.q + np.radians(1.0) * np.eye(7)[joint]), lib)
    assert TRUST not in words
    size = float(words.split(f"encoder of fr3_joint{joint + 1} that reads ")[1].split()[0])
    assert size == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("delay", [0.003, -0.002])
def test_a_delay_is_named_with_its_size(lib, trajectories, delay):
    """Oracle: torque stamped 3 ms late or 2 ms early at 100 Hz; σ of the delay is 0.05 ms."""
    log = logged(lib, trajectories[0], 0)
    late = np.stack([np.interp(log.t - delay, log.t, row) for row in log.tau.T], axis=1)
    words = advice(log.replace(tau=late), lib)
    assert TRUST not in words
    side = "late" if delay > 0 else "early"
    assert f"ms too {side}" in words
    # Linear interpolation between rows of 10 ms is a delay to 5 %.
    size = float(words.split("stamped ")[1].split()[0])
    assert size == pytest.approx(1e3 * abs(delay), rel=0.07)


@pytest.mark.parametrize(("delay", "stroke"), [(0.02, 0.003), (0.02, 0.006), (0.06, 0.003)])
def test_a_delay_is_stated_as_the_option_estimates_it(lib, trajectories, delay, stroke):
    """Oracle: the delay planted. Friction with a memory takes up a part of its column, so that the
    residuals alone state 33 ± 2 ms of 20; what is stated is the delay of `--delay auto`.
    """
    log = logged(lib, trajectories[0], 0)
    log = log.replace(tau=log.tau + 3.0 * dahl_state(log.q, stroke))
    tau = np.stack([np.interp(log.t - delay, log.t, row) for row in log.tau.T], axis=1)
    late = log.replace(tau=tau)
    words = advice(late, lib)
    size, _, sigma = words.split("stamped ")[1].split()[:3]
    assert float(size) == pytest.approx(1e3 * delay, abs=1.96 * float(sigma))
    settings = Settings(friction=TERMS, preparation=FILTERED)
    drive = identify_drive(late, lib, settings, DriveRequest(delay=True)).drive
    assert float(size) == pytest.approx(1e3 * drive.delay[0], abs=0.06)
    known = replace(FILTERED, torque_delay_s=drive.delay[0])
    settled = identify_recording(late, lib, friction=TERMS, preparation=known)
    assert "stamped" not in settled.uncertainty.advice()


def test_a_long_delay_is_not_blamed_on_the_urdf(lib, trajectories):
    """Property: torques 30 ms late are no model of the arm; the clock is named as the cause."""
    log = logged(lib, trajectories[0], 0)
    late = np.stack([np.interp(log.t - 0.03, log.t, row) for row in log.tau.T], axis=1)
    words = advice(log.replace(tau=late), lib)
    assert "do not trust" in words
    assert "ms too late for the motion: the clock of the torque is wrong" in words
    assert "the URDF is wrong" not in words


def test_a_result_short_of_the_data_is_named(lib, trajectories):
    """Property: the misfit of the result itself counts; here all its masses are 20 % too large."""
    log = logged(lib, trajectories[0], 0)
    right = identify_recording(log, lib, friction=TERMS, preparation=FILTERED)
    train = samples_of(right.train, lib)
    u = uncertainty_of(lib, train, 1.2 * right.pi, right.phi, first_guess=lib.pi0)
    assert TRUST not in u.advice()
    assert "the method stopped short of the data" in u.advice()


def gripping(recording: Recording, joints: tuple[int, ...]) -> Recording:
    """The same log with 0.8 N·m exp(−|dq| / 0.05) sgn dq more on some joints."""
    tau = recording.tau.copy()
    dq = recording.dq[:, joints]
    tau[:, joints] += 0.8 * np.exp(-np.abs(dq) / 0.05) * np.sign(dq)
    return recording.replace(tau=tau)


@pytest.mark.parametrize("method", ["map", "ols"])
def test_friction_without_a_column_is_named(lib, trajectories, method):
    """Oracle: a peak of another shape than that of the test, on joint 2."""
    words = advice(gripping(logged(lib, trajectories[0], 1), (1,)), lib, method)
    assert TRUST not in words
    assert "the residuals of fr3_joint2 contain friction" in words
    assert "intervals are too narrow" in words


@pytest.mark.parametrize("seed", range(3))
def test_described_friction_raises_no_alarm(lib, trajectories, seed):
    """Property: with right columns the test of friction stays below its threshold (20 of 20)."""
    assert "contain friction" not in advice(logged(lib, trajectories[seed], seed), lib)


def test_a_refit_keeps_the_tests_of_the_training_rows(lib, trajectories, monkeypatch):
    """Property: the fit to all rows is not tested again, and its result has the same sentences."""
    calls = []
    tested = uncertainty.model_tests

    def counted(*args, **keywords):
        calls.append(args)
        return tested(*args, **keywords)

    monkeypatch.setattr(uncertainty, "model_tests", counted)
    log = gripping(logged(lib, trajectories[0], 1), (1,))
    result = identify_recording(log, lib, friction=TERMS, preparation=FILTERED, refit=True)
    assert len(calls) == 1
    assert result.uncertainty.model_errors
    assert "contain friction" in result.uncertainty.advice()
