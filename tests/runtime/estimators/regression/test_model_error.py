"""Scatter of scores between blocks, and its part of a posterior."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.estimators.regression import model_error
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.model_error import (
    BLOCK_S,
    free_fit,
    model_error_of,
    scatter,
    time_step,
)
from runtime.estimators.regression.samples import Samples
from runtime.library import Library

RATE, BLOCKS, COLUMNS = 20.0, 60, 3


def _rows(rng: np.random.Generator) -> tuple[Samples, np.ndarray]:
    """Rows of one joint that moves at 1 rad/s, and an orthonormal basis of three columns."""
    count = round(BLOCKS * BLOCK_S * RATE)
    q = np.arange(count)[:, None] / RATE
    still = np.zeros_like(q)
    samples = Samples(q, np.ones_like(q), still, still, np.zeros((count, 1, 0)))
    return samples, np.linalg.qr(rng.normal(size=(count, COLUMNS)))[0]


def test_white_residuals_scatter_as_their_noise() -> None:
    """Oracle: V = S 1; 60 blocks know the mean of three variances to a tenth, four σ of that."""
    samples, q = _rows(np.random.default_rng(0))
    rest = 0.3 * np.random.default_rng(1).normal(size=(len(q), 1))
    spread = scatter(samples, q, rest, 0.09)
    assert np.trace(spread) / COLUMNS == pytest.approx(0.09, rel=0.4)
    assert np.abs(spread - np.diag(np.diag(spread))).max() < 4 * 0.09 / np.sqrt(BLOCKS)


def test_coefficients_that_differ_between_blocks_count_in_their_direction() -> None:
    """Oracle: with a coefficient s_k in block k, V_ii = S + Σ (q_iᵀ q_0)_k² s_k², to four σ."""
    samples, q = _rows(np.random.default_rng(0))
    rng, length = np.random.default_rng(1), round(BLOCK_S * RATE)
    sizes = np.repeat(5.0 * rng.normal(size=BLOCKS), length)
    rest = (sizes * q[:, 0] + 0.3 * rng.normal(size=len(q)))[:, None]
    spread = scatter(samples, q, rest, 0.09)
    for i in range(COLUMNS):
        shares = np.add.reduceat(q[:, 0] * q[:, i], np.arange(0, len(q), length))
        wanted = 0.09 + np.sum((shares * sizes[::length]) ** 2)
        assert spread[i, i] == pytest.approx(wanted, rel=4 * np.sqrt(2 / BLOCKS))


def test_few_blocks_keep_the_noise() -> None:
    """Property: two blocks say nothing."""
    samples, q = _rows(np.random.default_rng(0))
    few = round(2 * BLOCK_S * RATE)
    spread = scatter(samples.rows(slice(few)), q[:few], np.ones((few, 1)), 0.09)
    assert np.array_equal(spread, 0.09 * np.eye(COLUMNS))


def test_rows_of_a_slow_motion_have_their_step() -> None:
    """Oracle: 20 Hz at a milliradian per second, and 0 at rest."""
    samples, _ = _rows(np.random.default_rng(0))
    slow = replace(samples, q=1e-3 * samples.q, dq=1e-3 * samples.dq)
    assert time_step(slow) == pytest.approx(1 / RATE, rel=1e-9)
    assert time_step(replace(samples, q=0 * samples.q, dq=0 * samples.dq)) == 0.0


def test_a_posterior_is_widened_where_blocks_scatter(fr3: Library) -> None:
    """Oracle: the covariance of least squares A⁻¹ V A⁻ᵀ from all rows, in A and in the free fit."""
    rng = np.random.default_rng(2)
    t = np.arange(1200) / 20.0
    phase = np.arange(1, 8) * 0.4
    q = fr3.home + 0.5 * np.sin(np.outer(t, phase))
    dq = 0.5 * phase * np.cos(np.outer(t, phase))
    ddq = -0.5 * phase**2 * np.sin(np.outer(t, phase))
    tau = fr3.inverse_dynamics(q, dq, ddq, fr3.pi0) + 0.05 * rng.normal(size=q.shape)
    drift = np.repeat(rng.normal(size=(30, 7)), 40, axis=0)  # steps of every block
    columns = np.ones((1200, 7, 1))
    samples = Samples(q, dq, ddq, tau, columns)
    weights = np.ones(7)
    sigmas = []
    for size in (0.0, 0.5):
        each = replace(samples, tau=tau + size * drift)
        fit = free_fit(fr3, each, weights)
        widened = model_error_of(fr3, fit, fr3.pi0, compress(fr3, each, weights)).statistics
        sigmas.append(np.linalg.norm(np.linalg.pinv(widened.factor), axis=1))
    offsets = slice(len(fr3.base_matrix), None)
    assert np.median(sigmas[1][offsets] / sigmas[0][offsets]) > 1.05


@pytest.mark.parametrize("shown", [0.2, 1.0, 30.0])
def test_the_posterior_of_one_gain(shown: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: s | r ~ N(z / (S i), 1 / i), i = |p_rest|²/S + 1/σ², for a share of i of the data."""
    monkeypatch.setattr(model_error, "common_size", lambda *given: given[-1])
    q, p = np.linalg.qr(np.random.default_rng(0).normal(size=(400, 2)))[0].T
    sigma, level, taken = 0.02, 0.09, 3.0
    size = np.sqrt(shown * level) / sigma
    torque, rest = (taken * q + size * p)[:, None], (0.7 * p)[:, None]
    scores, _ = model_error.change_error(np.array([[taken]]), torque[..., None], rest, level, sigma)
    information = (1 + shown) / sigma**2
    wanted = taken * np.array([1 / np.sqrt(information), 0.7 * size / level / information])
    np.testing.assert_allclose(np.abs(scores[0]), wanted, rtol=1e-9)


def test_few_blocks_scatter_more_than_their_mean_square() -> None:
    """Oracle: the sample variance of ten blocks is k/(k − 1) times their mean square."""
    samples, _ = _rows(np.random.default_rng(0))
    count = round(10 * BLOCK_S * RATE)
    basis, rest = np.ones((count, 1)), np.repeat(np.arange(10.0) - 4.5, count // 10)[:, None]
    found = scatter(samples.rows(slice(count)), basis, rest, 0.0)
    sums = count / 10 * rest[:: count // 10, 0]
    # One sample of 40 may be counted to the next block by rounding.
    assert found.item() == pytest.approx(sums @ sums / 0.9, rel=0.01)
