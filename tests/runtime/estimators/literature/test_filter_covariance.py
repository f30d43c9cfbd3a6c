"""Covariance of the extended Kalman filter against the textbook's recursion and a random walk."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.estimators.literature.kalman import (
    DELAY,
    JITTER,
    WANDER,
    FilterInput,
    _advance,
    filter_input_from,
    run_ekf,
)
from runtime.library import Library
from runtime.recording import Friction, Recording

DT = 1e-3


def filter_input(lib: Library, trajectories, pi: np.ndarray, count: int) -> FilterInput:
    """Exact torque at 1 kHz; positions on a line, whose first speed is that of any count."""
    t = np.arange(count) * DT + 1.0
    q, dq, ddq = trajectories[0].at(lib, t)[:3]
    tau = lib.inverse_dynamics(q, dq, ddq, pi) + 0.4 * dq
    data = filter_input_from(
        Recording(t, q, None, None, tau), DT, Friction(("viscous", "coulomb"), 0.05)
    )
    line = q[0] + (t - t[0])[:, None] * dq[0]
    return replace(data, q=line, sigma_q=np.full(7, 1e-5), sigma_tau=np.full(7, 0.5))


def test_one_step_gives_the_textbooks_covariance(lib: Library, trajectories, pi_true) -> None:
    """Oracle: P ← (1 − K H)(F P Fᵀ + G diag(σ_τ²) Gᵀ + …), G = ∂[q, dq]/∂τ by differences.

    F is that of `_advance`, which has a test of its own. Central differences of a map that is
    linear in τ: rounding 1e-16/1e-3 over slopes of 1e-3, 1e-9.
    """
    data = filter_input(lib, trajectories, pi_true, 60)
    lam = lib.lam_from_pi(pi_true)
    first = replace(data, q=data.q[:2], tau=data.tau[:2])
    x, p, _ = run_ekf(lib, first, lam)
    top = np.zeros((14, x.size))
    _advance(lib, data, 1, x, top)
    slopes = np.empty((14, 7))
    for j in range(7):
        ends = []
        for sign in (1, -1):
            tau = data.tau.copy()
            tau[1, j] += 1e-3 * sign
            ends.append(_advance(lib, replace(data, tau=tau), 1, x, np.zeros_like(top))[0])
        slopes[:, j] = (ends[0] - ends[1]) / 2e-3
    F = np.eye(x.size)
    F[:14] = top
    Q = np.zeros_like(p)
    Q[:14, :14] = (slopes * data.sigma_tau**2) @ slopes.T
    Q[range(7, 14), range(7, 14)] += JITTER
    late = np.arange(x.size - 7, x.size)
    Q[late, late] += (WANDER * DT) ** 2 * DT
    expected = F @ p @ F.T + Q
    gain = np.linalg.solve(expected[:7, :7] + np.diag(data.sigma_q**2), expected[:7])
    expected = expected - gain.T @ expected[:7]
    next_one = replace(data, q=data.q[:3], tau=data.tau[:3])
    found = run_ekf(lib, next_one, lam)[1]
    size = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-8
    # The noise of the torque is seen beside the unknown speed of 1e-4 (rad/s)².
    assert (np.diag(Q)[7:14] > 1e-2 * np.diag(F @ p @ F.T)[7:14]).all()


@pytest.mark.parametrize("count", [50, 400])
def test_the_delay_is_a_random_walk_while_nothing_shows_it(lib: Library, count: int) -> None:
    """Oracle: a torque that does not change has no delay: var δ = DELAY² dt² + t WANDER² dt²."""
    still, zero = np.tile(lib.home, (count, 1)), np.zeros((count - 1, 7))
    tau = lib.inverse_dynamics(still, 0 * still, 0 * still, lib.pi0)
    deviations = np.full(7, 1e-5), np.full(7, 0.05)
    data = FilterInput(DT, still, tau, zero, zero, zero, *deviations, ("viscous",), 0.05)
    p = run_ekf(lib, data, lib.lam0)[1]
    expected = (DELAY * DT) ** 2 + (count - 1) * DT * (WANDER * DT) ** 2
    np.testing.assert_allclose(np.diag(p)[-7:], expected, rtol=1e-9)
