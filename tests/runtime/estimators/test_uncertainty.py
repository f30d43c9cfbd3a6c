"""Counts of the uncertainty: effective samples of coloured noise, and the rank of a motion."""

import dataclasses

import numpy as np
import pytest

from runtime.estimators.convex.entropic_prior import prior_of
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.problem import Problem
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import (
    LAGS,
    Samples,
    autocorrelation,
    samples_of,
    thesis_weights,
)
from runtime.estimators.uncertainty import uncertainty_of, vague_posterior
from runtime.library import Library
from runtime.recording import Recording


def test_coloured_noise_lowers_the_effective_sample_size(
    lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray
) -> None:
    """Oracle: AR(1) noise of ρ = 0.9 enters slow motions (1 + ρ)/(1 − ρ) = 19 times as strongly.

    The motion has harmonics up to 1 Hz of samples at 100 Hz, where the spectrum has fallen to no
    less than a half; white noise counts fully. The fit and its uncertainty state the same number.
    """
    run, rng = ideal_runs[0], np.random.default_rng(2)
    white = 0.05 * rng.normal(size=run.tau.shape)
    coloured = white.copy()
    for k in range(1, len(white)):
        coloured[k] = 0.9 * coloured[k - 1] + np.sqrt(1 - 0.81) * white[k]
    shares = []
    for noise in (white, coloured):
        s = samples_of(run.replace(tau=run.tau + noise), lib)
        fit = fit_map(Problem(lib, s, s, thesis_weights(s.tau), lib.lam_from_pi(pi_true)))
        u = uncertainty_of(
            lib, s, fit.pi, fit.phi, first_guess=pi_true,
            statistics=fit.statistics, coloured_noise=fit.coloured_noise,
        )  # fmt: skip
        assert fit.n_eff is not None
        assert fit.n_eff == pytest.approx(u.n_eff, rel=1e-12)
        shares.append(fit.n_eff / len(s))
    # S of 43 unknowns has some 90 cosines: 3 √(2/90).
    assert shares[0] == pytest.approx(1.0, abs=0.45)
    assert 1 / 30 < shares[1] < 1 / 8


MOTIONS = [
    *(((1,), 0.5), ((6,), 0.5), ((0, 1), 0.5), ((1, 3, 5), 0.5)),
    *(((0, 1, 2, 3, 4, 5), 0.5), (tuple(range(7)), 0.5), (tuple(range(7)), 0.03)),
]
"""Joints that move, and how far, rad; small motions excite all directions, but weakly."""


@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize(("moving", "size"), MOTIONS)
def test_rank_is_that_of_the_motion(
    lib: Library, moving: tuple[int, ...], size: float, friction: bool
) -> None:
    """Oracle: numpy's rank of [Y_b F] less that of F, columns of unit length.

    Neither hidden by noise nor by the prior; joints at rest leave columns that are exactly zero.
    """
    rng = np.random.default_rng(len(moving))
    q, dq, ddq = np.tile(lib.home, (300, 1)), np.zeros((300, 7)), np.zeros((300, 7))
    for j in moving:
        q[:, j] += size * rng.normal(size=300)
        dq[:, j], ddq[:, j] = 2 * size * rng.normal(size=(2, 300))
    columns = dq[:, :, None] if friction else np.zeros((300, 7, 0))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + 0.4 * columns.sum(axis=2)
    s = Samples(q, dq, ddq, tau + 0.05 * rng.normal(size=tau.shape), columns)
    fit = fit_map(Problem(lib, s, s, thesis_weights(tau), lib.lam0))
    u = uncertainty_of(lib, s, fit.pi, fit.phi, first_guess=lib.pi0)
    rigid = lib.base_regressor(q, dq, ddq).reshape(-1, 43)
    rubbing = np.zeros((300, 7, 7))
    rubbing[:, np.arange(7), np.arange(7)] = dq
    rubbing = rubbing.reshape(-1, 7)[:, : 7 if friction else 0]
    assert u.rank == _rank(np.hstack([rigid, rubbing])) - (_rank(rubbing) if friction else 0)


def test_the_weakest_direction_is_that_of_the_regressor(lib: Library) -> None:
    """Oracle: least over largest singular value of Y_b, columns of unit length, of a small motion.

    Lengths of columns are far from 1, so that one that is not scaled changes the ratio.
    """
    rng = np.random.default_rng(3)
    q = lib.home + 0.05 * rng.normal(size=(300, 7))
    dq, ddq = 0.1 * rng.normal(size=(2, 300, 7))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + 0.05 * rng.normal(size=q.shape)
    s, weights = Samples(q, dq, ddq, tau, np.zeros((300, 7, 0))), np.ones(7)
    statistics = compress(lib, s, weights)
    u = uncertainty_of(
        lib, s, lib.pi0, np.zeros(0), first_guess=lib.pi0, statistics=statistics,
        coloured_noise=coloured_noise_of(lib, [s], statistics, weights),
    )  # fmt: skip
    rigid = lib.base_regressor(q, dq, ddq).reshape(-1, 43)
    sizes = np.linalg.svd(rigid / np.linalg.norm(rigid, axis=0), compute_uv=False)
    # The QR of the compression is exact to 1e-16 of the largest value.
    assert u.conditioning == pytest.approx(sizes[-1] / sizes[0], rel=1e-9)

    def ranked(factor: np.ndarray) -> tuple[int, float]:
        u = uncertainty_of(
            lib, s, lib.pi0, np.zeros(0), first_guess=lib.pi0,
            statistics=dataclasses.replace(statistics, factor=factor),
            coloured_noise=coloured_noise_of(lib, [s], statistics, weights), tests=False,
        )  # fmt: skip
        return u.rank, u.conditioning

    assert ranked(np.zeros((43, 43))) == (0, 0.0)
    # Columns that differ by δ: singular values √43, 41 times δ, and δ/√43. They count from 1e-9
    # of the largest on: 3e-9 and 5e-10 here, then 3e-10.
    for delta, rank in ((2e-8, 42), (2e-9, 1)):
        almost = np.diag(np.full(43, delta))
        almost[0] = 1.0
        assert ranked(almost)[0] == rank


def test_noise_whiteness_and_advice_are_those_of_the_residuals(lib: Library) -> None:
    """Oracle: Σ r²/(N − n_b/n) without a friction coefficient; 95 % of the lags of white noise.

    Statistics without their coloured noise are not used: the same as without both. The band of
    torque contains the noise; more than two rows per independent one are advised about.
    """
    rng = np.random.default_rng(3)
    q = lib.home + 0.05 * rng.normal(size=(300, 7))
    dq, ddq = 0.1 * rng.normal(size=(2, 300, 7))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + 0.05 * rng.normal(size=q.shape)
    s = Samples(q, dq, ddq, tau, np.zeros((300, 7, 0)))
    given = (lib, s, lib.pi0, np.zeros(0))
    u = uncertainty_of(*given, first_guess=lib.pi0, tests=False)
    half = compress(lib, s, np.full(7, 2.0))
    again = uncertainty_of(*given, first_guess=lib.pi0, statistics=half, tests=False)
    assert (again.n_eff, again.conditioning) == (u.n_eff, u.conditioning)
    band = u.torque_band(lib, q, dq, ddq)
    np.testing.assert_allclose(band, np.hypot(u.model_band(lib, q, dq, ddq), u.noise), rtol=1e-12)

    likely = dataclasses.replace(u, rank=43, inflation=1.9)
    assert "autocorrelated" not in likely.advice()
    correlated = dataclasses.replace(likely, inflation=2.1)
    assert "autocorrelated" in correlated.advice()
    # Of a filter that leaves as much of white noise nothing is doubted.
    filtered = dataclasses.replace(correlated, filtered=2.0)
    assert "look independent beyond the low-pass filter" in filtered.advice()

    rest = rng.normal(size=(1000, 7)) * np.arange(1, 8)
    other = u.with_noise(rest, lib)
    power = np.sum(rest**2, axis=0) / (1000 - 43 / 7)
    np.testing.assert_allclose(other.noise, np.sqrt(power), rtol=1e-12)
    within = np.abs(autocorrelation(rest)) < 1.96 / np.sqrt(1000)
    np.testing.assert_array_equal(other.white, within.sum(axis=0) / LAGS)
    # 4 σ of a binomial share of LAGS lags.
    np.testing.assert_allclose(other.white, 0.95, atol=4 * np.sqrt(0.05 * 0.95 / LAGS))
    assert np.all(u.with_noise(np.cumsum(rest, axis=0), lib).white < 0.5)


def test_trust_counts_where_the_estimate_is_the_most_probable(lib: Library) -> None:
    """Property: κ narrows the model of a prior, which `pi` is unless another method says so."""
    rng = np.random.default_rng(3)
    q, dq, ddq = 0.1 * rng.normal(size=(3, 100, 7))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + 0.05 * rng.normal(size=q.shape)
    s = Samples(q, dq, ddq, tau, np.zeros((100, 7, 0)))

    def spread(kappa: float, **method: bool) -> np.ndarray:
        u = uncertainty_of(
            lib, s, lib.pi0, np.zeros(0), first_guess=lib.pi0, kappa=kappa, tests=False, **method
        )
        return np.linalg.norm(u.root[:, :-1], axis=1)

    assert np.all(spread(1e6) < 0.02 * spread(1.0))
    np.testing.assert_array_equal(spread(1e6), spread(1e6, is_most_probable=True))
    wide = spread(1e6, is_most_probable=False)
    np.testing.assert_array_equal(wide, spread(1.0, is_most_probable=False))


@pytest.mark.parametrize("unit", [1.0, 1e-5])
def test_a_rotor_that_an_inertia_explains_costs_no_rank(lib: Library, unit: float) -> None:
    """Oracle: the rotor of joint 1 turns about the axis of link 1's ZZ; their sum is excited.

    Whatever the unit of its column, whose length is then below 1.
    """
    rng = np.random.default_rng(1)
    q, dq, ddq = rng.normal(size=(3, 300, 7))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + 0.1 * ddq
    s = Samples(q, dq, ddq, tau + 0.05 * rng.normal(size=tau.shape), unit * ddq[:, :, None])
    fit = fit_map(Problem(lib, s, s, thesis_weights(tau), lib.lam0))
    u = uncertainty_of(lib, s, fit.pi, fit.phi, first_guess=lib.pi0)
    assert u.rank == len(lib.base_columns) == 43
    assert "excites all 43" in u.advice() or u.inflation > 2


def _rank(matrix: np.ndarray) -> int:
    lengths = np.linalg.norm(matrix, axis=0)
    return int(np.linalg.matrix_rank(matrix / np.where(lengths > 0, lengths, 1.0), tol=1e-8))


def test_the_vague_posterior_is_shrunk_to_the_prior(lib: Library) -> None:
    """Oracle: Bayes' rule of one mass, whose variance is that of the entropic prior of trust 1.

    A mass of 1.3 times the prior's that is measured as well as the prior knows it is estimated half
    way between the two.
    """
    prior = prior_of(lib)
    around = lib.nearest_realisable(prior.centre, 1 / 3)
    hessian = prior.bodies.curvature(around)[1][-1]
    sigma = np.sqrt(np.linalg.inv(hessian)[0, 0])
    row = np.eye(lib.pi0.size)[[-10]] / sigma
    mass = prior.centre[-10]
    mean, root = vague_posterior(lib, prior, row, np.array([1.3 * mass / sigma]))
    assert mean[-10] == pytest.approx(1.15 * mass, rel=1e-6)
    assert np.linalg.norm(root[-10]) == pytest.approx(sigma / np.sqrt(2), rel=1e-6)
