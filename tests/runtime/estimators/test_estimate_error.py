"""Intervals of an estimate: those of every method contain the truth, and no prior narrows them.

Oracle: simulated logs of a robot whose parameters are those of the URDF.
"""

import numpy as np
import pytest
from scipy import signal

from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.problem import Problem
from runtime.estimators.regression.samples import samples_of, thesis_weights
from runtime.estimators.uncertainty import uncertainty_of
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Recording, Split
from runtime.simulation import Plant, ideal

TRIALS = 30
SCORE = 1.96
WORST = 0.76
"""0.95 less 5 standard deviations of a share of 30, as the least of 43 shares."""


@pytest.fixture(scope="module")
def run(lib: Library, trajectories) -> Recording:
    """10 s of the robot of the URDF, without noise."""
    return ideal(lib, trajectories[0], Plant(lib.pi0))


@pytest.mark.parametrize("noise", [0.05, 0.0065])
def test_a_thin_link_of_the_urdf_does_not_narrow_intervals(lib, run, noise):
    """Property: 95 % intervals of every base parameter hold with the floor of the prior.

    Link 7 of the URDF is a needle of half a millimetre. 0.0065 N·m stands for a log of ten minutes,
    where the interval of ZZ7 held in 5 % of the trials.
    """
    beta, held = lib.base_matrix @ lib.pi0, []
    for seed in range(TRIALS):
        rng = np.random.default_rng(seed)
        noisy = run.replace(tau=run.tau + noise * rng.normal(size=run.tau.shape))
        samples = samples_of(noisy, lib)
        fit = fit_map(Problem(lib, samples, samples, thesis_weights(samples.tau), lib.lam0))
        known = {"statistics": fit.statistics, "coloured_noise": fit.coloured_noise}
        u = uncertainty_of(lib, samples, fit.pi, fit.phi, first_guess=lib.pi0, **known)
        held.append(np.abs(lib.base_matrix @ fit.pi - beta) < SCORE * u.beta_sigma)
    shares = np.mean(held, axis=0)
    assert shares.min() >= WORST
    assert 0.93 <= shares.mean() <= 0.985


@pytest.mark.parametrize("method", ["ols", "pc-ols", "adam"])
def test_intervals_of_other_methods_are_about_their_answers(lib, run, method):
    """Property: they hold for a first guess 10 % off; with the covariance of MAP 44 to 88 % did."""
    rng = np.random.default_rng(3)
    lam0 = lib.lam0 * (1 + 0.1 * rng.normal(size=lib.lam0.size))
    split, beta, held = Split((0, 0.9), (0.9, 0.95), (0.95, 1)), lib.base_matrix @ lib.pi0, []
    for _ in range(6):
        noisy = run.replace(tau=run.tau + 0.05 * rng.normal(size=run.tau.shape))
        result = identify_recording(noisy, lib, method, split=split, lam0=lam0)
        assert result.uncertainty is not None
        held.append(np.abs(result.beta - beta) < SCORE * result.uncertainty.beta_sigma)
    # 6 trials of 43 parameters that hang together: σ of the share is about 2 %.
    assert np.mean(held) >= 0.90


def test_intervals_of_least_squares_are_those_of_its_covariance(lib, run):
    """Oracle: σ² (YᵀY)⁻¹ of white noise, for parameters that the data determine."""
    rng = np.random.default_rng(0)
    noisy = run.replace(tau=run.tau + 0.05 * rng.normal(size=run.tau.shape))
    result = identify_recording(noisy, lib, "ols", gain_sigma=0)
    train = samples_of(result.train, lib)
    rows = train.base_rows(lib).reshape(-1, len(lib.base_columns))
    expected = 0.05 * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    assert result.uncertainty is not None
    ratio = result.uncertainty.beta_sigma / expected
    # S of 43 unknowns has some 90 cosines: σ is known to 8 %; weights of 7 joints add some percent.
    assert 0.8 < np.median(ratio) < 1.25


def test_a_parameter_of_the_base_has_a_verdict(lib, run):
    """Property: at 0.05 N·m the data determine the first moments, and not ZZ of the needle."""
    rng = np.random.default_rng(0)
    noisy = run.replace(tau=run.tau + 0.05 * rng.normal(size=run.tau.shape))
    u = identify_recording(noisy, lib).uncertainty
    assert u is not None
    names = [(int(c) // 10 + 1, int(c) % 10) for c in lib.base_columns]
    verdicts = dict(zip(names, u.beta_verdicts, strict=True))
    assert verdicts[7, 1] == verdicts[2, 1] == "identified"
    assert verdicts[7, 6] == "prior-dominated"


def test_a_parameter_that_the_prior_decides_is_not_identified(lib, run):
    """Oracle: ZZ of link 2 in slow noise; C_v is 2.5 times C, and 300 of 300 intervals held.

    The data reduce its prior variance 200-fold; the prior of the other links does as much.
    """
    rho, rng = 0.9, np.random.default_rng(0)
    slow = signal.lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=run.tau.shape), axis=0)
    names = [(int(c) // 10 + 1, int(c) % 10) for c in lib.base_columns]
    for noise, expected in ((rng.normal(size=slow.shape), "identified"), (slow, "prior-dominated")):
        u = identify_recording(run.replace(tau=run.tau + 0.05 * noise), lib).uncertainty
        assert u is not None
        verdicts = dict(zip(names, u.beta_verdicts, strict=True))
        assert verdicts[2, 4] == expected
