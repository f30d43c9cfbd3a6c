"""coloured_noise: effective sample size of coloured noise; oracles are known spectra and numpy."""

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import toeplitz

from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.problem import Problem
from runtime.estimators.regression import coloured_noise
from runtime.estimators.regression.coloured_noise import (
    ColouredNoise,
    coloured_noise_of,
    coloured_noise_of_rows,
)
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import (
    Samples,
    autocorrelation,
    noise,
    samples_of,
    thesis_weights,
)
from runtime.estimators.uncertainty import uncertainty_of
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, ideal

COUNT, JOINTS = 400, 2
MEAN = np.ones(5) / np.sqrt(5)
"""Mean of five neighbours, variance one: S = 5 at frequency zero."""


def columns(unknowns: int) -> np.ndarray:
    """Sines of 1/2 … periods, of which the two joints see different parts, (N, n, p)."""
    t = (np.arange(COUNT) + 0.5) / COUNT
    phases = np.random.default_rng(2).uniform(0, 2 * np.pi, (JOINTS, unknowns))
    return np.sin(np.pi * np.outer(t, 1 + np.arange(unknowns))[:, None] + phases)


def coloured(rng: np.random.Generator, kernel: np.ndarray) -> np.ndarray:
    white = rng.normal(size=(COUNT + len(kernel) - 1, JOINTS))
    return signal.convolve(white, kernel[:, None], mode="valid")


@pytest.mark.parametrize("kernel", [np.ones(1), MEAN], ids=["white", "mean of five"])
@pytest.mark.parametrize("unknowns", [4, 40])
def test_level_is_the_variance_of_the_unknowns(kernel: np.ndarray, unknowns: int) -> None:
    """Oracle: tr(Qᵀ Ω Q)/p with the noise's own covariance Ω; σ² = 1.

    40 unknowns take up half of what there is at their frequencies.
    """
    rng, rows = np.random.default_rng(0), columns(unknowns)
    basis = np.linalg.qr(rows.reshape(-1, unknowns))[0].reshape(COUNT, JOINTS, unknowns)
    lags = np.correlate(kernel, kernel, mode="full")[len(kernel) - 1 :]
    omega = toeplitz(np.r_[lags, np.zeros(COUNT - len(lags))])
    truth = np.einsum("ijk,il,ljk->", basis, omega, basis) / unknowns
    estimated = [coloured_noise_of_rows(rows, coloured(rng, kernel)) for _ in range(300)]
    levels = np.array([one.density for one in estimated])
    # 300 trials; a spectrum that falls by a tenth over the columns' frequencies leaves 3 %.
    slack = 4 * levels.std() / np.sqrt(300) + (0.03 * truth if len(kernel) > 1 else 0.0)
    assert levels.mean() == pytest.approx(truth, abs=slack)
    assert np.mean([one.variance for one in estimated]) == pytest.approx(1.0, abs=0.02)
    assert np.mean([one.inflation for one in estimated]) == pytest.approx(truth, rel=0.05)


def test_noise_of_the_base_parameters_alone(lib: Library) -> None:
    """Property: noise at the frequency of a friction column does not widen intervals of β.

    White noise of variance 1, and 25 times as much at the 250th to 279th cosine, where the friction
    is; base parameters have the first 129 cosines.
    """
    t, rng = (np.arange(COUNT) + 0.5) / COUNT, np.random.default_rng(4)
    waves = np.cos(np.pi * np.outer(t, np.arange(COUNT))) * np.sqrt(2 / COUNT)
    base = (waves[:, 1:130] @ rng.normal(size=(129, len(lib.base_columns))))[:, None]
    near = waves[:, 250:280]
    columns = (near @ rng.normal(size=(30, 20)))[:, None]
    base += 0.3 * columns.sum(axis=2, keepdims=True)  # not orthogonal to friction
    alone, both = [], []
    for _ in range(40):
        tau = rng.normal(size=COUNT) + 5 * near @ rng.normal(size=30)
        zero = np.zeros((COUNT, 1))
        samples = Samples(zero, zero, None, tau[:, None], columns, base=base)
        statistics = compress(lib, samples, np.ones(1))
        alone.append(coloured_noise_of(lib, [samples], statistics, np.ones(1), True).density)
        both.append(coloured_noise_of(lib, [samples], statistics, np.ones(1)).density)
    # 40 trials with 86 cosines each: 2.4 % for a variance, four of them.
    assert np.mean(alone) == pytest.approx(1.0, abs=0.1)
    assert np.mean(both) > 3


def filtered(recording: Recording, rng: np.random.Generator, sigma: float) -> Recording:
    """With white noise at the full rate."""
    assert recording.tau is not None
    return recording.replace(tau=recording.tau + sigma * rng.normal(size=recording.tau.shape))


@pytest.fixture(scope="module")
def still(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> Recording:
    """10 s at 500 Hz without noise."""
    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, coulomb_speed=0.03)
    return ideal(lib, trajectories[0], plant, rate_hz=500.0)


def test_intervals_of_low_passed_logs_hold_the_truth(
    lib: Library, still: Recording, pi_true: np.ndarray
) -> None:
    """Monte Carlo through preparation, MAP and its covariance: 10 s, 10 Hz, 100 Hz.

    Noise of variance σ² at 500 Hz has 2 σ²/500 per Hz; at 100 Hz that is S = σ² · 100/500, whatever
    the filter. The prior is the truth's, so that nothing but noise moves the answer.
    """
    sigma, trials = 0.1, 12
    low = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.1, rate_hz=100.0)
    rng, scores, levels = np.random.default_rng(1), [], []
    for _ in range(trials):
        log = prepare(filtered(still, rng, sigma), low, Friction(("viscous", "coulomb"), 0.03))
        s = samples_of(log, lib)
        start = lib.lam_from_pi(pi_true)
        fit = fit_map(Problem(lib, s, s, thesis_weights(s.tau), start))
        known = {"statistics": fit.statistics, "coloured_noise": fit.coloured_noise}
        u = uncertainty_of(lib, s, fit.pi, fit.phi, first_guess=pi_true, **known)
        scores.append((lib.base_matrix @ (fit.pi - pi_true)) / u.beta_sigma)
        levels.append(fit.coloured_noise.density / fit.weights.mean())
    # A level is known to 12 %, twelve of them to 3.5 %; three of those and the weights' own.
    assert np.mean(levels) == pytest.approx(sigma**2 * 100 / 500, rel=0.13)
    # The prior's own spread, which no trial draws, makes the covariance a little too large.
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.1
    assert 0.92 < np.mean(np.abs(scores) < 1.96) < 0.99


def test_samples_and_dense_rows_tell_the_same(lib: Library, noisy: Recording) -> None:
    """Oracle: the rows [Y_b F] written out; parts of a log, a silent column and any model."""
    terms = Friction(("viscous", "coulomb"), 0.03)
    s = samples_of(prepare(noisy, None, terms), lib)
    still = np.concatenate([s.columns, np.zeros((*s.tau.shape, 1))], axis=2)
    s = Samples(s.q, s.dq, s.ddq, s.tau, still)
    weights = np.linspace(100.0, 700.0, 7)
    estimated = coloured_noise_of(lib, [s], compress(lib, s, weights), weights)
    extra = np.einsum("ijk,jl->ijlk", s.columns, np.eye(7)).reshape(len(s), 7, 21)
    rows = np.concatenate([lib.base_regressor(s.q, s.dq, s.ddq), extra], axis=2)
    scale = np.sqrt(weights)
    dense = coloured_noise_of_rows(rows * scale[:, None], s.tau * scale)
    # Rounding × condition of the columns.
    assert dense.density == pytest.approx(estimated.density, rel=1e-6)
    assert dense.variance == pytest.approx(estimated.variance, rel=1e-6)
    moved = coloured_noise_of_rows(rows * scale[:, None], (s.tau + rows @ np.ones(64)) * scale)
    assert moved.density == pytest.approx(dense.density, rel=1e-6)
    halves = [s.rows(slice(0, 500)), s.rows(slice(500, None))]
    parted = coloured_noise_of(lib, halves, compress(lib, s, weights), weights)
    # Other cosines of the same noise, 130 of them: √(2/130), three times.
    assert parted.density == pytest.approx(estimated.density, rel=0.38)


def test_a_long_log_is_transformed_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: eight pieces of a thousand rows know the level nearly as the whole does."""
    rng, slow = np.random.default_rng(0), ([1], [1, -0.8])
    rows, rest = (signal.lfilter(*slow, rng.normal(size=(40_000, 1, k)), axis=0) for k in (5, 1))
    rest = rest[:, :, 0]
    lengths = []
    whole = coloured_noise._spectral_sums
    monkeypatch.setattr(
        coloured_noise, "_spectral_sums", lambda q, r: lengths.append(len(q)) or whole(q, r)
    )
    estimated = coloured_noise_of_rows(rows, rest)
    assert lengths == [1024] * 8
    monkeypatch.undo()
    monkeypatch.setattr(coloured_noise, "PIECE", 40_000)
    # Of 8192 cosines a tenth are as loud as the noise they weigh: √(2/800), four times.
    assert estimated.density == pytest.approx(coloured_noise_of_rows(rows, rest).density, rel=0.2)


@pytest.mark.parametrize(
    ("rows", "rest"),
    [
        (np.ones((50, 2, 1)), np.zeros((50, 2))),
        (np.zeros((50, 2, 3)), np.random.default_rng(0).normal(size=(50, 2))),
        (np.random.default_rng(1).normal(size=(4, 2, 8)), np.ones((4, 2))),
    ],
    ids=["exact", "silent", "as many as equations"],
)
def test_without_an_estimate_noise_counts_as_white(rows: np.ndarray, rest: np.ndarray) -> None:
    """Property: finite, and an inflation of one."""
    estimated = coloured_noise_of_rows(rows, rest)
    assert np.isfinite([estimated.density, estimated.variance]).all()
    assert estimated.inflation == pytest.approx(1.0)


def test_white_noise_is_the_power_per_free_equation() -> None:
    """Oracle: four samples less three cosines leave one equation, of 1.5² · 4 = 9."""
    turns = np.pi * (np.arange(4) + 0.5) / 4
    rows = np.cos(np.outer(turns, [0, 1, 3]))[:, None]
    target = 0.5 + 1.5 * np.array([[1.0], [-1.0], [-1.0], [1.0]]) + 3 * rows[:, :, 1]
    estimated = coloured_noise_of_rows(rows, target)
    assert (estimated.density, estimated.variance) == pytest.approx((9.0, 9.0), rel=1e-12)


def test_residual_noise_knows_what_the_unknowns_took(lib: Library, noisy: Recording) -> None:
    """Oracle: each of 57 unknowns takes as much noise as `inflation` samples have."""
    rest = np.random.default_rng(0).normal(size=(1000, 7))
    expected = np.sqrt(np.sum(rest**2, axis=0) / (1000 - 5 * 57 / 7))
    np.testing.assert_allclose(noise(rest, lib, 14, 5.0), expected)


def test_columns_of_any_unit_count() -> None:
    """Property: a column of length 1e-12 takes as much of the noise as one of length 1."""
    rng = np.random.default_rng(5)
    rows, target = rng.normal(size=(60, 2, 3)), rng.normal(size=(60, 2))
    one = coloured_noise_of_rows(rows, target)
    other = coloured_noise_of_rows(rows * [1.0, 1e-12, 1e3], target)
    assert other.density == pytest.approx(one.density, rel=1e-9)
    assert other.variance == pytest.approx(one.variance, rel=1e-9)


def test_a_fit_of_more_columns_than_rows_leaves_no_noise() -> None:
    """Oracle: four equations are solved by six columns to rounding."""
    rng = np.random.default_rng(5)
    noise_of = coloured_noise_of_rows(rng.normal(size=(2, 2, 6)), rng.normal(size=(2, 2)))
    assert (noise_of.density, noise_of.variance) == pytest.approx((0.0, 0.0), abs=1e-20)


@pytest.mark.parametrize(
    ("density", "variance", "inflation"), [(6.0, 2.0, 3.0), (0.0, 2.0, 1.0), (6.0, 0.0, 1.0)]
)
def test_inflation_is_a_ratio_of_variances(density: float, variance: float, inflation: float):
    """Oracle: S/σ² by hand; without noise rows count as independent."""
    assert ColouredNoise(density, variance).inflation == inflation


def test_the_variance_counts_what_the_unknowns_took_up() -> None:
    """Oracle: σ² = (‖r‖² + p S) / (n N) with S = Σ h r̂² / Σ h (1 − h), by hand."""
    sums = [np.array([[2.0], [3.0], [1.0]]), np.array([[1.0], [3.0], [1.0]])]
    found = coloured_noise._noise_from_sums(sums, 10.0, 4, 20.0)
    assert (found.density, found.variance) == pytest.approx((0.5, 0.6))


def test_autocorrelation_of_a_chain() -> None:
    """Oracle: AR(1) with ρ = 0.8 has ρ at lag one."""
    rest = signal.lfilter([1], [1, -0.8], np.random.default_rng(0).normal(size=(20_000, 3)), axis=0)
    assert autocorrelation(rest)[0] == pytest.approx(0.8, abs=0.02)
