"""ekf and .ukf: they follow their own model exactly, and the plant well."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.literature.kalman import (
    FilterInput,
    _advance,
    filter_input_from,
    noise_of,
    prior_covariance,
    run_ekf,
    run_ukf,
)
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.recording import Friction, Recording, Split
from tests.runtime.estimators.plant import (
    COULOMB,
    FRICTION,
    SPEED,
    VISCOUS,
    SimulatedCase,
    simulated_case,
)
from tests.taylor import assert_second_order, taylor_slope

SIGMA_Q, SIGMA_TAU, DT = 1e-5, 0.05, 1e-3


@pytest.fixture(scope="module")
def plant(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> SimulatedCase:
    return simulated_case(lib, trajectories[0], trajectories[2], pi_true, SIGMA_Q)


def modelled(
    lib: Library, trajectory: Trajectory, pi: np.ndarray, count: int, rng: np.random.Generator
) -> FilterInput:
    """Data of the very model that the filters believe in, written out step by step."""
    wanted = np.stack(trajectory.at(lib, np.arange(count) * DT)[:3], axis=1)
    q, dq = wanted[0, 0], wanted[0, 1]
    log_q, log_tau = np.empty((2, count, 7))
    for k in range(count):
        u = wanted[k, 2] + 30 * (wanted[k, 1] - dq) + 225 * (wanted[k, 0] - q)
        tau = lib.inverse_dynamics(q, dq, u, pi) + COULOMB * np.tanh(dq / SPEED) + VISCOUS * dq
        log_q[k], log_tau[k] = q, tau
        secant = VISCOUS + COULOMB * np.tanh(dq / SPEED) / np.where(dq == 0, SPEED, dq)
        secant = np.where(dq == 0, VISCOUS + COULOMB / SPEED, secant)
        mass = lib.mass_matrix(q, pi)
        right = mass @ dq + DT * (tau - lib.bias_forces(q, dq, pi))
        after = np.linalg.solve(mass + DT * np.diag(secant), right)
        q, dq = q + DT * (dq + after) / 2, after
    log_q += SIGMA_Q * rng.normal(size=log_q.shape)
    log_tau += SIGMA_TAU * rng.normal(size=log_tau.shape)
    log = Recording(np.arange(count) * DT, log_q, None, None, log_tau)
    return filter_input_from(log, DT, FRICTION)


def scores(lib: Library, pi: np.ndarray, x: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Base parameters, then φ, as found by the EKF: errors over their deviations."""
    k, friction = lib.base_matrix, np.stack([COULOMB, VISCOUS], 1).ravel()
    sigma = np.sqrt(np.diag(k @ p[14:84, 14:84] @ k.T))
    base = (k @ (x[14:84] - pi)) / sigma
    return np.concatenate([base, (x[84:98] - friction) / np.sqrt(np.diag(p)[84:98])])


def test_both_filters_follow_their_model(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray, plant: SimulatedCase
) -> None:
    """Oracle: parameters of a robot that is stepped as filters once did; EKF and UKF agree."""
    data = modelled(lib, trajectories[0], pi_true, 800, np.random.default_rng(5))
    x, p, _ = run_ekf(lib, data, plant.lam_cad)
    y, r = run_ukf(lib, data, plant.lam_cad)
    k, beta = lib.base_matrix, lib.base_matrix @ pi_true
    first = np.linalg.norm(k @ lib.pi_from_lam(plant.lam_cad) - beta)
    assert first > 0.02 * np.linalg.norm(beta)
    sigma = np.sqrt(np.diag(k @ p[14:84, 14:84] @ k.T))
    # What is left of second order: measured 0.1 of a deviation.
    assert np.all(np.abs(k @ x[14:84] - y[14:57]) < 0.3 * sigma)
    assert np.sqrt(np.diag(r)[14:57]) == pytest.approx(sigma, rel=0.05)
    # 57 numbers of size one, some of them alike: 3/√(2·20).
    estimated = scores(lib, pi_true, x, p)
    assert np.sqrt(np.mean(estimated**2)) < 1.5
    assert np.abs(estimated).max() < 4


def test_filters_run_without_friction_columns(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray, plant: SimulatedCase
) -> None:
    """Property: a log without friction, or `friction=Friction(())`, is no error."""
    data = modelled(lib, trajectories[0], pi_true, 40, np.random.default_rng(5))
    data = replace(data, names=())
    for run in (run_ekf, run_ukf):
        assert np.isfinite(run(lib, data, plant.lam_cad)[0]).all()


def test_filters_on_the_common_plant(plant: SimulatedCase) -> None:
    """Property: from 5 % in λ to below 1 % of the base parameters, finite, bad links reported."""
    start = plant.lib.base_matrix @ plant.lib.pi_from_lam(plant.lam_cad)
    beta = plant.lib.base_matrix @ plant.pi
    assert np.linalg.norm(start - beta) > 0.02 * np.linalg.norm(beta)
    for method, share in (("ekf", 0.3), ("ukf", 0.15)):
        short = Split((0.0, share), (share, share + 0.02), (share + 0.02, 1.0))
        estimated = plant.identify(method, split=short)
        assert np.isfinite(estimated.pi).all()
        assert np.isfinite(estimated.phi).all()
        assert plant.base_error(estimated) < 1.0
        # The heavy joints' friction, 0.4 to 0.6, is seen early.
        assert estimated.phi[:4] == pytest.approx(np.stack([COULOMB, VISCOUS], 1)[:4], abs=0.15)
        assert f"filtered {estimated.iterations} samples" in estimated.status
        if method == "ekf" and not estimated.is_consistent:
            assert any("not physically consistent at" in note for note in estimated.notes)


@pytest.mark.parametrize(("seed", "every"), [(0, 1), (2, 5)])
def test_deviations_hold_on_the_common_plant(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray, seed: int, every: int
) -> None:
    """Monte Carlo, small: two logs and CAD models in closed loop, one of them at 200 Hz.

    Rotors, a torque that is held for a period and noise in the loop are in no filter's model.
    """
    case = simulated_case(lib, trajectories[0], trajectories[2], pi_true, SIGMA_Q, seed=seed)
    data = filter_input_from(case.log.take(slice(0, 2000, every), "Cut."), DT * every, FRICTION)
    estimated = scores(lib, pi_true, *run_ekf(lib, data, case.lam_cad)[:2])
    # As above; ten seeds of 10 s have 0.9 and 3.2 at most.
    assert np.sqrt(np.mean(estimated**2)) < 1.5
    assert np.abs(estimated).max() < 4.5


def test_filters_say_what_they_need(plant: SimulatedCase, lib: Library) -> None:
    """Property: a slow log, a hole, foreign friction and a robot that is another: one sentence."""
    slow = plant.log.take(np.arange(0, len(plant.log), 10), "Kept every tenth.")
    for method in ("ekf", "ukf"):
        with pytest.raises(
            IdentificationError, match="without gaps at 200 Hz or more, got 0 gaps at 1"
        ):
            replace(plant, log=slow).identify(method, None)
        with pytest.raises(IdentificationError, match="uses the friction columns viscous, coul"):
            plant.identify(method, friction=Friction(("viscous", "dahl")))
    noise = noise_of(plant.log.q)
    # 10 000 samples know σ to 0.7 %; the jerk of the noisy loop adds a little.
    assert noise == pytest.approx(np.full(7, SIGMA_Q), rel=0.1)


def test_a_filter_that_diverges_is_refused(plant: SimulatedCase, lib: Library) -> None:
    """Property: a torque beyond all numbers ends in a sentence, not in NaN."""
    data = filter_input_from(plant.log.take(slice(0, 400), "Cut."), DT, Friction(("viscous",)))
    data = replace(data, tau=1e200 * data.tau)
    for run in (run_ekf, run_ukf):
        with pytest.raises(IdentificationError, match=r"the filter diverged after \d"):
            run(lib, data, plant.lam_cad)


def test_prior_covariance_is_that_of_perturbed_bodies(lib: Library) -> None:
    """Oracle: the covariance of π over perturbed λ, where no entry of λ is below its floor."""
    rng = np.random.default_rng(0)
    lam = lib.lam0.copy().reshape(7, 10)
    lam += np.where(np.abs(lam) < 0.4, 0.4, 0.0)
    draws = lam.ravel() * (1 + 0.05 * rng.normal(size=(20_000, 70)))
    estimated = prior_covariance(lib, lam.ravel())
    sigma = np.sqrt(np.diag(estimated))
    seen = np.cov(lib.pi_from_lam(draws).T)
    # 20 000 draws: 0.7 % of a correlation; second order of 5 % relative: some percent of σ².
    assert np.abs((seen - estimated) / np.outer(sigma, sigma)).max() < 0.1


def test_derivative_of_a_step(lib: Library, plant: SimulatedCase, pi_true: np.ndarray) -> None:
    """Derivative: the Taylor remainder of [q, dq] after a step falls as h²."""
    rng = np.random.default_rng(0)
    data = filter_input_from(plant.log, DT, Friction(("coulomb", "viscous", "offset"), 0.3))
    phi, delay = rng.uniform(0.2, 0.6, 21), rng.normal(0, DT, 7)
    push, speed, drift = rng.normal(0, 1, (3, 7))
    dq = speed - DT / 2 * push
    x = np.concatenate([lib.home, dq, pi_true, phi, delay])
    # A torque that gives the acceleration at which the derivative is taken.
    middle, by_joint = lib.home + DT / 2 * dq, phi.reshape(7, 3)
    friction = np.tanh(speed / 0.3) * by_joint[:, 0] + speed * by_joint[:, 1] + by_joint[:, 2]
    tau = lib.inverse_dynamics(middle, speed, push, pi_true) + friction - delay * drift
    ways = {"speed": speed, "acceleration": push, "torque_rate": drift, "tau": tau}
    data = replace(data, **{name: value[None] for name, value in ways.items()})
    top = np.zeros((14, x.size))
    scale = np.concatenate([np.ones(14), np.abs(pi_true) + 1e-3, phi, np.full(7, DT)])
    along = 0.1 * scale * rng.normal(size=x.size)
    moved, _ = _advance(lib, data, 0, x, top)
    assert moved[7:14] == pytest.approx(dq + DT * push, abs=1e-12)
    slope = top @ along

    def step(at: np.ndarray) -> np.ndarray:
        return _advance(lib, data, 0, at, np.zeros_like(top))[0]

    # Positions of size 1 round at 1e-16 and remainders begin at 1e-4: five decades of h at most.
    assert_second_order(taylor_slope(step, x, along, slope, largest=0.1), 3.0)
