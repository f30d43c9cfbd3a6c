"""runtime.baselines.ekf and .ukf: they follow their own model exactly, and the plant well."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.baselines.ekf import _advance, run_ekf
from runtime.baselines.stream import Stream, noise_of, prior_covariance
from runtime.baselines.ukf import run_ukf
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.recording import Friction, Split
from scripts.bench.plant import COULOMB, SPEED, VISCOUS, Bench, bench
from tests.taylor import assert_second_order, taylor_slope

SIGMA_Q, SIGMA_TAU, DT = 1e-5, 0.05, 1e-3


@pytest.fixture(scope="module")
def plant(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> Bench:
    return bench(lib, trajectories[0], trajectories[2], pi_true, SIGMA_Q)


def modelled(
    lib: Library, trajectory: Trajectory, pi: np.ndarray, count: int, rng: np.random.Generator
) -> Stream:
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
    one = np.ones(7)
    names = ("coulomb", "viscous")
    return Stream(DT, log_q, log_tau, SIGMA_Q * one, SIGMA_TAU * one, names, SPEED)


def test_both_filters_follow_their_model(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray, plant: Bench
) -> None:
    """Oracle: the model's own parameters; EKF and UKF agree within three deviations."""
    stream = modelled(lib, trajectories[0], pi_true, 800, np.random.default_rng(5))
    x, p, _ = run_ekf(lib, stream, plant.lam_cad)
    y, r = run_ukf(lib, stream, plant.lam_cad)
    k, beta = lib.base_matrix, lib.base_matrix @ pi_true
    first = np.linalg.norm(k @ lib.pi_from_lam(plant.lam_cad) - beta)
    assert first > 0.02 * np.linalg.norm(beta)
    sigma = np.sqrt(np.diag(k @ p[14:84, 14:84] @ k.T))
    assert np.all(np.abs(k @ x[14:84] - y[14:57]) < 3 * sigma)
    assert np.all(np.abs(k @ x[14:84] - y[14:57]) < 3 * np.sqrt(np.diag(r)[14:57]))
    # What the first joints feel is known to its deviation; the last one's friction bends within
    # the noise of its speed, which both filters linearise alike.
    assert np.all(np.abs(k @ x[14:84] - beta)[:10] < 4 * sigma[:10])


def test_filters_on_the_common_plant(plant: Bench) -> None:
    """Property: from 5 % in λ to below 1 % of the base parameters, finite, bad links reported."""
    start = plant.lib.base_matrix @ plant.lib.pi_from_lam(plant.lam_cad)
    beta = plant.lib.base_matrix @ plant.pi
    assert np.linalg.norm(start - beta) > 0.02 * np.linalg.norm(beta)
    for method, share in (("ekf", 0.3), ("ukf", 0.15)):
        short = Split((0.0, share), (share, share + 0.02), (share + 0.02, 1.0))
        found = plant.identify(method, splitting=short)
        assert np.isfinite(found.pi).all()
        assert np.isfinite(found.phi).all()
        assert plant.base_error(found) < 1.0
        # The heavy joints' friction, 0.4 to 0.6, is seen early.
        assert found.phi[:4] == pytest.approx(np.stack([COULOMB, VISCOUS], 1)[:4], abs=0.15)
        assert f"filtered {found.iterations} samples" in found.status
        if method == "ekf" and not found.is_consistent:
            assert any("links that cannot exist at" in note for note in found.notes)


def test_filters_say_what_they_need(plant: Bench, lib: Library) -> None:
    """Property: a slow log, a hole, foreign friction and a robot that is another: one sentence."""
    slow = plant.log.take(np.arange(0, len(plant.log), 10), "Kept every tenth.")
    for method in ("ekf", "ukf"):
        with pytest.raises(
            IdentificationError, match="without holes at 200 Hz or more, got 1 at 1"
        ):
            replace(plant, log=slow).identify(method, None)
        with pytest.raises(IdentificationError, match="knows the friction columns viscous, coul"):
            plant.identify(method, friction_columns=Friction(("viscous", "dahl")))
    noise = noise_of(plant.log.q)
    # 10 000 samples know σ to 0.7 %; the jerk of the noisy loop adds a little.
    assert noise == pytest.approx(np.full(7, SIGMA_Q), rel=0.1)


def test_a_filter_that_diverges_is_told(plant: Bench, lib: Library) -> None:
    """Property: a torque beyond all numbers ends in a sentence, not in NaN."""
    one = np.ones(7)
    log = plant.log
    for run in (run_ekf, run_ukf):
        stream = Stream(
            DT, log.q[:400], 1e200 * log.tau[:400], SIGMA_Q * one, one, ("viscous",), SPEED
        )
        with pytest.raises(IdentificationError, match=r"the filter diverged after \d"):
            run(lib, stream, plant.lam_cad)


def test_prior_covariance_is_that_of_perturbed_bodies(lib: Library) -> None:
    """Oracle: the covariance of π over perturbed λ, where no entry of λ is below its floor."""
    rng = np.random.default_rng(0)
    lam = lib.lam0.copy().reshape(7, 10)
    lam += np.where(np.abs(lam) < 0.4, 0.4, 0.0)
    draws = lam.ravel() * (1 + 0.05 * rng.normal(size=(20_000, 70)))
    found = prior_covariance(lib, lam.ravel())
    sigma = np.sqrt(np.diag(found))
    seen = np.cov(lib.pi_from_lam(draws).T)
    # 20 000 draws: 0.7 % of a correlation; second order of 5 % relative: some percent of σ².
    assert np.abs((seen - found) / np.outer(sigma, sigma)).max() < 0.1


def test_derivative_of_a_step(lib: Library, plant: Bench, pi_true: np.ndarray) -> None:
    """Derivative: the Taylor remainder of [q, dq] after a step falls as h²."""
    rng = np.random.default_rng(0)
    names = ("coulomb", "viscous", "offset")
    one = np.ones(7)
    stream = Stream(DT, plant.log.q, plant.log.tau, one, one, names, 0.3)
    phi = rng.uniform(0.2, 0.6, 21)
    x = np.concatenate([lib.home, rng.normal(0, 0.5, 7), pi_true, phi])
    tau, top = rng.normal(0, 5, 7), np.zeros((14, x.size))
    scale = np.concatenate([np.ones(14), np.abs(pi_true) + 1e-3, phi])
    along = 0.1 * scale * rng.normal(size=x.size)
    _advance(lib, stream, x, tau, top)
    slope = top @ along

    def step(at: np.ndarray) -> np.ndarray:
        return _advance(lib, stream, at, tau, np.zeros_like(top))[0]

    # Positions of size 1 round at 1e-16 and remainders begin at 1e-4: five decades of h at most.
    assert_second_order(taylor_slope(step, x, along, slope, largest=0.1), 3.0)
