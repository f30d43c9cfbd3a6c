"""expected_accuracy and `predict`: Monte Carlo, dense algebra, logs that really are longer."""

import re

import numpy as np
import pytest
from scipy.linalg import block_diag

from runtime import OnlineEstimator, Recording, identify_payload
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.excitation import Trajectory
from runtime.excitation.search.criteria import unseen_joints, unseen_rows
from runtime.excitation.search.information import FRICTION
from runtime.identification.expected_accuracy.expected import (
    ARM_ERROR,
    Knowledge,
    expected,
    gained,
    unseen_torque,
)
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    motion_samples_of,
    noise_of,
    planned_recording,
)
from runtime.identification.payload.arm_error import ArmModel
from runtime.library import Library
from runtime.recording import Friction
from runtime.simulation import Plant, ideal
from tests.runtime.trials import (
    SIGMA,
    TRIALS,
    T,
    assert_variance,
    errors,
    pinocchio_rows,
    with_friction,
)

TERMS = Friction(FRICTION)


@pytest.fixture(scope="module")
def rows(lib: Library, trajectories: tuple[Trajectory, ...]) -> np.ndarray:
    """Pinocchio's 70 columns there."""
    return pinocchio_rows(lib, trajectories[0], T)


def test_base_parameters_by_monte_carlo(
    lib: Library, moved: MotionSamples, rows: np.ndarray
) -> None:
    """Oracle: 200 fits by numpy's least squares to Pinocchio's regressor, friction estimated."""
    result = expected(lib, moved.statistics(lib, SIGMA), Knowledge.of(lib))
    assert result.base is not None
    dq = moved.samples.dq
    missed = errors(with_friction(rows[:, :, lib.base_columns], dq, FRICTION), SIGMA, 0)[:, :43]
    for k in range(43):
        assert_variance(missed[:, k] ** 2, result.base[k] ** 2, 1)
    # All of them together: 200 trials of 43 numbers, less than 43 of which are independent.
    ratio = np.mean(missed**2 / result.base**2)
    assert abs(ratio - 1) < 5 * np.sqrt(2 / TRIALS / 10)
    assert (result.base_map < result.base * (1 + 1e-9)).all()  # the prior adds information


def test_a_payload_by_monte_carlo(lib: Library, moved: MotionSamples, rows: np.ndarray) -> None:
    """Oracle: 200 fits of ten parameters and seven offsets to Pinocchio's last ten columns."""
    result = expected(lib, moved.statistics(lib, SIGMA), Knowledge.of(lib), 1.0, FRICTION)
    assert result.payload is not None
    missed = errors(with_friction(rows[:, :, -10:], moved.samples.dq, ("offset",)), SIGMA, 1)
    for k in range(10):
        assert_variance(missed[:, k] ** 2, result.payload.pi[k] ** 2, 1)
    com = np.array([0, 0, 0.1])
    drift = (com + missed[:, 1:4]) / (1 + missed[:, :1]) - com
    for k in range(3):
        assert_variance(drift[:, k] ** 2, result.payload.com[k] ** 2, 1)
    # 200 trials do not see the sign of the share of the mass: dense algebra does.
    whole = with_friction(rows[:, :, -10:], moved.samples.dq, ("offset",))
    whole = whole / np.tile(SIGMA, 1001)[:, None]
    single = np.linalg.inv(whole.T @ whole)[:4, :4]
    slope = np.hstack([-com[:, None], np.eye(3)])
    sigma = np.sqrt(np.diag(slope @ single @ slope.T))
    assert result.payload.com == pytest.approx(sigma, rel=1e-8)  # rounding × cond²


def test_payload_prediction_is_what_the_command_payload_says_later(
    lib: Library, trajectories: tuple[Trajectory, ...], moved: MotionSamples, pi_true: np.ndarray
) -> None:
    """Oracle: σ of the mass that `identify_payload` reports of a simulated log with 1 kg."""
    body = np.array([1.0, 0, 0, 0.1, 0.012, 0.012, 0.002, 0, 0, 0])
    loaded = pi_true.copy()
    loaded[-10:] += body
    plant = Plant(loaded, torque_noise=SIGMA)
    log = ideal(lib, trajectories[0], plant, rng=np.random.default_rng(3))
    arm = ArmModel(pi_true, Friction(()), np.zeros((7, 0)), "the truth", is_exact=True)
    reported = identify_payload(log, lib, arm=arm, gain_error=0.0)
    result = expected(lib, moved.statistics(lib, SIGMA), Knowledge.of(lib), 1.0, FRICTION)
    assert result.payload is not None
    # The noise of 1001 residuals per joint is known to 2 %; the ball as prior counts for nothing.
    assert result.payload.pi[0] == pytest.approx(reported.white.sigma[0], rel=0.05)
    assert abs(reported.body.mass - 1) < 5 * result.payload.pi[0]


def test_the_error_of_the_arm_is_what_identify_payload_makes_of_it(
    lib: Library, trajectories: tuple[Trajectory, ...], moved: MotionSamples
) -> None:
    """Oracle: errors of the mass with arms whose links are 3 % off, without an empty run.

    The expected 0.3 g of a known arm are a five-hundredth of them.
    """
    result = expected(lib, moved.statistics(lib, SIGMA), Knowledge.of(lib), 1.0, FRICTION)
    assert result.payload is not None
    body = np.array([1.0, 0, 0, 0.1, 0.012, 0.012, 0.002, 0, 0, 0])
    roots = bodies_of(lib).spread(prior_of(lib).centre)
    arm = ArmModel(lib.pi0, Friction(()), np.zeros((7, 0)), "off", is_exact=True)
    rng, wrong = np.random.default_rng(2), []
    for _ in range(40):
        pi = lib.pi0 + ARM_ERROR * np.concatenate([root @ rng.normal(size=10) for root in roots])
        pi[-10:] += body
        log = ideal(lib, trajectories[0], Plant(pi))
        wrong.append(identify_payload(log, lib, arm=arm).body.mass - 1)
    # 40 draws know σ to 11 %; the prior of the payload and its weights of the joints add some.
    assert np.sqrt(np.mean(np.square(wrong))) == pytest.approx(result.payload.of_arm[0], rel=0.4)


def test_links_by_dense_algebra(lib: Library, moved: MotionSamples, rows: np.ndarray) -> None:
    """Oracle: numpy's inverse of Pinocchio's information with friction and the prior's curvature.

    The curvature is that of −log det P by its dense formula, whose inverse nobody takes in runtime.
    """
    known = Knowledge.of(lib)
    result = expected(lib, moved.statistics(lib, SIGMA), known, 4.0)
    whole = with_friction(rows, moved.samples.dq, FRICTION) / np.tile(SIGMA, 1001)[:, None]
    gram = whole.T @ whole / 4.0
    curvature = block_diag(*known.prior.bodies.curvature(known.pi)[1])
    gram[:70, :70] += CAD * curvature
    scale = 1 / np.sqrt(np.diag(gram))
    inverse = scale[:, None] * np.linalg.inv(gram * np.outer(scale, scale)) * scale
    sigma = np.sqrt(np.diag(inverse))[:70]
    # Rounding × cond of the scaled information (1e9).
    assert result.pi == pytest.approx(sigma, rel=1e-5)
    com = known.pi.reshape(7, 10)
    for k in range(7):
        single = inverse[10 * k : 10 * k + 4, 10 * k : 10 * k + 4]
        slope = np.hstack([-com[k, 1:4, None] / com[k, 0], np.eye(3)]) / com[k, 0]
        assert result.com[k] == pytest.approx(np.sqrt(np.diag(slope @ single @ slope.T)), rel=1e-5)
    unseen = unseen_rows(lib, lib.home)
    spread = lib.base_matrix @ inverse[:70, :70] @ lib.base_matrix.T
    band = np.sqrt(np.einsum("tjk,kl,tjl->j", unseen, spread, unseen) / len(unseen))
    by_errors = unseen_torque(lib.base_matrix @ result.root, unseen_joints(lib, lib.home))
    assert by_errors == pytest.approx(band, rel=1e-5)


def joined(*parts: Recording) -> Recording:
    """One recording of several on a common clock: a log that really is longer."""
    end, t = 0.0, []
    for part in parts:
        t.append(part.t - part.t[0] + end)
        end = t[-1][-1] + 0.01
    arrays = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in ("q", "dq", "ddq", "tau")
        if getattr(parts[0], key) is not None
    }
    return Recording(np.concatenate(t), **arrays, name="long")


@pytest.mark.parametrize("other", [False, True], ids=["same", "another"])
def test_more_is_what_the_longer_log_says(
    lib: Library, trajectories: tuple[Trajectory, ...], moved: MotionSamples, other: bool
) -> None:
    """Oracle: prediction of a recording that has the further seconds in it, 23.7 s of 10.01 s."""
    motions = [planned_recording(m, T, lib, "x") for m in trajectories[:2]]
    following = motions[1] if other else motions[0]
    rest = following.take(slice(0, 2370 - 2002), "Cut.")
    longer = motion_samples_of(joined(motions[0], following, following, rest), lib, None, TERMS)
    further = motion_samples_of(following, lib, None, TERMS)
    facts = moved.statistics(lib, SIGMA).merged(further.statistics(lib, SIGMA, 23.7))
    known = Knowledge.of(lib)
    one = expected(lib, facts, known, 1.0, FRICTION)
    two = expected(lib, longer.statistics(lib, SIGMA), known, 1.0, FRICTION)
    assert one.payload is not None
    assert two.payload is not None
    pairs = [(getattr(one, key), getattr(two, key)) for key in ("base", "base_map", "pi")]
    for first, second in (
        *pairs,
        (one.payload.pi, two.payload.pi),
        (one.payload.com, two.payload.com),
    ):
        # Reflections in another order, times cond of the raw columns.
        assert first == pytest.approx(second, rel=1e-8)
    now = expected(lib, moved.statistics(lib, SIGMA), known, 1.0, FRICTION)
    gain_of_recording = gained(now.by_name(lib), one.by_name(lib), 23.7, "x")
    assert now.payload is not None
    assert gain_of_recording.gains["payload mass"] == pytest.approx(
        1 - two.payload.pi[0] / now.payload.pi[0]
    )
    assert list(gain_of_recording.gains.values()) == pytest.approx(
        sorted(gain_of_recording.gains.values())[::-1], abs=2e-3
    )
    if not other:  # information ∝ laps, of which there are more than 3 and less than 4
        assert 1 - np.sqrt(1 / 3) < gain_of_recording.gains["payload mass"] < 1 - np.sqrt(1 / 4)


def test_correlated_residuals_count_as_fewer(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray, rows: np.ndarray
) -> None:
    """Oracle: 200 fits of a payload under noise that is the mean of five neighbours.

    The noise is taken from logs of 10 s, in which 64 unknowns swallow most of its slow patterns.
    """
    rng = np.random.default_rng(5)
    kernel = np.full(5, 1 / np.sqrt(5))  # variance one

    def coloured(shape: tuple[int, ...]) -> np.ndarray:
        white = rng.normal(size=(shape[0] + 4, *shape[1:]))
        return sum(k * white[i : i + shape[0]] for i, k in enumerate(kernel))

    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, coulomb_speed=TERMS.coulomb_speed)
    lap = ideal(lib, trajectories[0], plant)
    assert lap.tau is not None
    logs = [lap.replace(tau=lap.tau + SIGMA * coloured((len(lap), 7))) for _ in range(16)]
    facts = [noise_of(lib, motion_samples_of(log, lib, None, TERMS)) for log in logs]
    units = [noise.inflation for noise in facts if noise is not None]
    # 5 at rest, 4.8 at the 2 Hz where the motion ends; one log determines it to 12 %.
    assert np.mean(units) == pytest.approx(4.9, rel=4 * 0.12 / 4)
    sigma = np.mean([noise.sigma for noise in facts if noise is not None], axis=0)
    assert sigma == pytest.approx(SIGMA, rel=0.06)  # 4 times 1/√(2·16·200), of which five are one
    known = Knowledge.of(lib)
    once = motion_samples_of(lap, lib, None, TERMS).statistics(lib, SIGMA)
    result = expected(lib, once, known, float(np.mean(units)), FRICTION)
    assert result.payload is not None
    columns = with_friction(rows[:, :, -10:], lap.dq, ("offset",))
    whitened = columns / np.tile(SIGMA, 1001)[:, None]
    trials = coloured((1001, 7, TRIALS)).reshape(7007, TRIALS)
    missed = np.linalg.lstsq(whitened, trials, rcond=None)[0][0]
    # 200 trials leave 5 %, four times; the inflation half of 3 %.
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(result.payload.pi[0], rel=0.21)


def test_a_running_estimator_advises_when_to_stop(lib: Library, noisy: Recording) -> None:
    """Oracle: statistics with the same samples taken in once more; long logs gain nothing."""
    samples = motion_samples_of(noisy, lib, None, TERMS).samples
    arrays = (samples.q, samples.dq, samples.ddq, samples.tau, samples.columns)
    online = OnlineEstimator(lib, np.full(7, 400.0), columns=3, every=10**9)
    with pytest.raises(IdentificationError, match="0 samples do not determine 64 unknowns"):
        online.gain_of_recording(10, 100)
    online.add(*arrays)
    pi, once = online.estimate().pi, online.statistics
    gain_of_recording = online.gain_of_recording(10.01, 100.0)
    known = Knowledge(online._prior, pi)
    unit = once.rest / (7 * 1001 - 64)
    names = [expected(lib, s, known, unit).by_name(lib) for s in (once, once.merged(once))]
    for name, gain in gained(*names, 10.01, "x").gains.items():
        assert gain_of_recording.gains[name] == pytest.approx(gain, abs=1e-8), name
    assert gain_of_recording.motion == "the same motion"
    assert re.match(r"10 s more of the same motion improve .* by 29 %.*: go on", online.advice(100))
    for _ in range(25):
        online.add(*arrays)
    # 260 s: 60 s more gain 1 − √(26/32) = 10 % of all; 30 s 5 %.
    facts = online.advice(100.0, (10.0, 30.0))
    assert re.fullmatch(
        r"30 s more of the same motion improve no value by 10 % \(.*5 %\): stop", facts
    )
    fading = OnlineEstimator(lib, columns=3, forgetting=0.99, every=10**9)
    fading.add(*arrays)
    assert (
        max(fading.gain_of_recording(60, 100).gains.values()) < 1e-4
    )  # what is remembered is full
    for wrong in ((0, 100), (10, 0), (np.inf, 100)):
        with pytest.raises(IdentificationError, match="seconds and a rate above 0"):
            fading.gain_of_recording(*wrong)
