"""classical on the common simulated plant: what every classical method must achieve."""

from dataclasses import replace

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError, SimulationError
from runtime.estimators.literature.iv_didim import ClosedLoop
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.simulation import Controller, Plant, ideal
from tests.runtime.estimators.plant import (
    COULOMB,
    FRICTION,
    SPEED,
    SPLIT,
    VISCOUS,
    SimulatedCase,
    simulated_case,
)

PHI = np.stack([COULOMB, VISCOUS], axis=1)


@pytest.fixture(scope="module")
def clean(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> Recording:
    """Exact states and torques of the plant, friction included."""
    plant = Plant(pi_true, viscous=VISCOUS, coulomb=COULOMB, coulomb_speed=SPEED)
    return ideal(lib, trajectories[0], plant)


@pytest.fixture(scope="module")
def noisy_q(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> SimulatedCase:
    """σ_q = 1e-4 rad, σ_τ = 0.05 N·m."""
    return simulated_case(lib, trajectories[0], trajectories[2], pi_true, 1e-4)


@pytest.fixture(scope="module")
def good_q(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> SimulatedCase:
    """σ_q = 1e-5 rad, σ_τ = 0.05 N·m."""
    return simulated_case(lib, trajectories[0], trajectories[2], pi_true, 1e-5)


@pytest.fixture(scope="module")
def quiet(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> SimulatedCase:
    """No noise at all."""
    return simulated_case(lib, trajectories[0], trajectories[2], pi_true, 0.0, sigma_tau=0.0)


def test_least_squares_recovers_the_truth(
    lib: Library, clean: Recording, pi_true: np.ndarray
) -> None:
    """Oracle: the parameters the data were made from; the normal equations by explicit rows."""
    beta = lib.base_matrix @ pi_true
    for method in ("ols", "wls"):
        estimated = identify_recording(
            clean, lib, method, friction=FRICTION, split=SPLIT, certify=False
        )
        # Rounding 1e-16 times the condition number of 6, over 57 unknowns.
        assert np.linalg.norm(estimated.beta - beta) < 1e-10 * np.linalg.norm(beta)
        assert estimated.phi == pytest.approx(PHI, abs=1e-10)
        samples = samples_of(estimated.train, lib)
        rows = samples.rows_of_unknowns(lib)
        stacked = rows.reshape(-1, rows.shape[2])
        # 43 base parameters and 14 of friction.
        assert np.linalg.matrix_rank(stacked) == 57
        rest = samples.tau - rows @ np.concatenate([estimated.beta, estimated.phi.ravel()])
        assert np.abs(stacked.T @ rest.ravel()).max() < 1e-8


def test_normal_equations_hold_with_noise(good_q: SimulatedCase) -> None:
    """Property: the residual of IDIM-OLS is orthogonal to every column."""
    estimated = good_q.identify("ols")
    samples = samples_of(estimated.train, good_q.lib)
    rows = samples.rows_of_unknowns(good_q.lib)
    stacked = rows.reshape(-1, rows.shape[2])
    rest = (samples.tau - rows @ np.concatenate([estimated.beta, estimated.phi.ravel()])).ravel()
    products = stacked.T @ rest / (np.linalg.norm(stacked, axis=0) * np.linalg.norm(rest))
    # Rounding: 1e-16 over the ratio of torque to residual, 1e3.
    assert np.abs(products).max() < 1e-8


def test_weights_tell_the_noise_of_the_joints(lib: Library, clean: Recording) -> None:
    """Oracle: known noise; the estimate varies far less than that of unweighted least squares."""
    sigma = np.array([0.01, 0.5, 0.01, 0.5, 0.01, 0.5, 0.01])
    rng = np.random.default_rng(0)
    estimated: dict[str, list[np.ndarray]] = {"ols": [], "wls": []}
    for _ in range(40):
        noisy = clean.replace(tau=clean.tau + sigma * rng.normal(size=clean.tau.shape))
        for method, estimates in estimated.items():
            result = identify_recording(
                noisy, lib, method, friction=FRICTION, split=SPLIT, certify=False
            )
            estimates.append(np.concatenate([result.beta, result.phi.ravel()]))
        words = result.notes[0].split(": ")[1].split(", ")
        # 900 samples: 2.4 % in σ; σ² within 10 % is 5 % of σ, two deviations of the worst of 7,
        # so the whole run of weights is checked by its mean below.
        assert np.array(words, dtype=float) == pytest.approx(sigma, rel=0.1)
    variance = {method: np.var(estimates, axis=0) for method, estimates in estimated.items()}
    ratio = variance["ols"] / variance["wls"]
    # What only loud joints feel, such as their friction, cannot gain; the rest gains up to 2500.
    assert np.median(ratio) > 2
    base = [np.sum(variance[method][:43]) for method in ("ols", "wls")]
    assert base[0] > 2 * base[1]


def test_weights_average_to_the_noise(lib: Library, clean: Recording) -> None:
    """Oracle: over 20 draws the mean weight is 1/σ² to 10 %."""
    from runtime.estimators.classical.least_squares import reweighted

    sigma = np.array([0.01, 0.5, 0.01, 0.5, 0.01, 0.5, 0.01])
    rng = np.random.default_rng(1)
    samples = samples_of(clean.replace(columns=np.zeros((len(clean), 7, 0)), column_names=()), lib)
    rigid = lib.inverse_dynamics(samples.q, samples.dq, samples.ddq, lib.pi0)
    weights = []
    for _ in range(20):
        drawn = [replace(samples, tau=rigid + sigma * rng.normal(size=rigid.shape))]
        weights.append(reweighted(lib, drawn.copy, (), None)[1])
    # One draw of 1000 samples: 4.5 % in 1/σ², 57 unknowns in 7007 rows take 1 % of it away.
    assert np.mean(weights, axis=0) * sigma**2 == pytest.approx(np.ones(7), rel=0.1)


def test_instruments_remove_the_bias_of_noisy_positions(noisy_q: SimulatedCase) -> None:
    """Property: at σ_q = 1e-4 and 20 Hz IDIM-IV and DIDIM err by less than a third of IDIM-OLS."""
    ols, iv, didim = (noisy_q.identify(method) for method in ("ols", "iv", "didim"))
    assert "converged after" in iv.status
    for estimated in (iv, didim):
        assert noisy_q.base_error(estimated) < noisy_q.base_error(ols) / 3
        # The first joint suffers most from friction that noise has smoothed.
        assert noisy_q.errors(estimated)[0] < noisy_q.errors(ols)[0] / 3
    # The specification's table has .12 .06 .39 % for joints 1, 4, 7; other motions, so twice.
    assert (noisy_q.errors(iv)[[0, 3, 6]] < [0.24, 0.12, 0.78]).all()


def test_instruments_say_when_they_fail(good_q: SimulatedCase) -> None:
    """Property: differentiated twice without a filter, the motion says nothing, and IV says so."""
    estimated = good_q.identify("iv", cutoff=None)
    assert estimated.status.startswith("not converged, the result of wls is kept: noise")
    assert np.array_equal(estimated.pi, good_q.identify("wls", cutoff=None).pi)


def test_didim_needs_the_torque_only(good_q: SimulatedCase, noisy_q: SimulatedCase) -> None:
    """Property: few iterations, and neither noise of the positions nor a filter matters much."""
    start = good_q.lib.pi_from_lam(good_q.lam_cad)
    beta = good_q.lib.base_matrix @ good_q.pi
    far = np.linalg.norm(good_q.lib.base_matrix @ start - beta) / np.linalg.norm(beta)
    assert far > 0.02
    for plant, cutoff in ((good_q, 20.0), (noisy_q, 20.0), (good_q, None), (noisy_q, None)):
        estimated = plant.identify("didim", cutoff)
        assert "converged after" in estimated.status
        assert estimated.iterations is not None
        assert estimated.iterations <= 5
        # The controller reacts to the noise too: unfiltered, σ_q = 1e-4 makes 1 N·m of real torque.
        # Elsewhere OLS has 0.7 % and 40 %, and the specification .055 to .15 % per joint.
        assert plant.base_error(estimated) < (3.0 if plant is noisy_q and not cutoff else 0.3)
    # 3 % where OLS has 99 %.
    assert good_q.errors(good_q.identify("didim", None)).max() < 3.0
    assert good_q.errors(good_q.identify("ols", None)).max() > 50.0


def test_simulated_methods_recover_the_truth_exactly(quiet: SimulatedCase) -> None:
    """Oracle: without noise and filter DIDIM ends at the robot that was simulated."""
    estimated = quiet.identify("didim", None)
    # The last step was below 1e-3 of the torque, and steps fall by a factor of 3 and more.
    assert quiet.base_error(estimated) < 0.03
    assert estimated.phi == pytest.approx(PHI, abs=1e-3)


def test_methods_that_simulate_ask_for_the_loop(good_q: SimulatedCase) -> None:
    """Property: no loop, a foreign reference, friction that cannot be simulated: one sentence."""
    for method in ("iv", "didim"):
        with pytest.raises(
            IdentificationError, match=r"its description; give .* --settings controller=FILE"
        ):
            good_q.identify(method, inputs=None)
    late = ClosedLoop(good_q.loop.reference, good_q.loop.controller, 0.1, start=1.0)
    with pytest.raises(
        IdentificationError, match=r"from 0\.000 to 10\.000 s, the reference from 1"
    ):
        good_q.identify("didim", inputs={"controller": late})


def test_a_first_guess_that_cannot_move_is_refused(good_q: SimulatedCase) -> None:
    """Property: gains that let the simulation run away are a sentence; IV keeps WLS."""
    wild = ClosedLoop(good_q.loop.reference, Controller(damping=0.0, stiffness=2e6), 0.1)
    with pytest.raises(SimulationError, match="the motion diverged"):
        good_q.identify("didim", inputs={"controller": wild})
    estimated = good_q.identify("iv", inputs={"controller": wild})
    assert "the result of wls is kept: the simulated robot stopped" in estimated.status


def test_joints_that_stand_still_are_reported(lib: Library, clean: Recording) -> None:
    """Property: a joint that never moves leaves columns silent, whatever the method."""
    still = clean.replace(
        q=np.where(np.arange(7) == 3, lib.home, clean.q),
        dq=np.where(np.arange(7) == 3, 0.0, clean.dq),
        ddq=np.where(np.arange(7) == 3, 0.0, clean.ddq),
    )
    for method in ("ols", "wls"):
        with pytest.raises(IdentificationError, match=r"the motion excites .* record a richer"):
            identify_recording(still, lib, method, friction=FRICTION, split=SPLIT, certify=False)


def test_a_computed_torque_has_no_weight(lib: Library, clean: Recording) -> None:
    """Property: a joint whose torque is exact does not blow its weight up; the note names it."""
    rng = np.random.default_rng(0)
    noise = 0.1 * rng.normal(size=clean.tau.shape) * (np.arange(7) != 6)
    tau = clean.tau + noise
    estimated = identify_recording(
        clean.replace(tau=tau), lib, "wls", friction=FRICTION, split=SPLIT, certify=False
    )
    assert np.isfinite(estimated.pi).all()
    assert any(lib.joint_names[6] in note and "measured" in note for note in estimated.notes)
