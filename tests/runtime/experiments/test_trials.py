"""Trials of the document's experiments, computed again from what their config states."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.estimators.descent.fit import Preset
from runtime.estimators.optimizers import AdamOptions, StoppingRule
from runtime.estimators.problem import Problem
from runtime.estimators.regression.samples import samples_of, thesis_weights
from runtime.experiments.trials import (
    Case,
    MonteCarloConfig,
    MonteCarloSetup,
    fit_frozen,
    problem_of,
    scorer_of,
)
from runtime.library import Library
from runtime.recording import Recording


def test_a_trial_is_that_of_its_config(
    lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray
) -> None:
    """Oracle: Eqs. 5.2 and 5.8 by numpy from seed, trial, perturbation and noise of the config."""
    train, held, test = (samples_of(run, lib) for run in ideal_runs)
    lam = lib.lam_from_pi(pi_true)
    config = MonteCarloConfig((), seed=11)
    scorer = scorer_of(lib, test, pi_true, 3)
    setup = MonteCarloSetup(lib, config, lam, {"designed": train}, held, scorer)
    for number, perturbation, sigma in ((0, 0.05, 0.1), (3, 0.3, 0.0)):
        made = problem_of(setup, Case("case", perturbation, sigma), number)
        draws = [np.random.default_rng((11, number, which)) for which in range(4)]
        guess = lam + perturbation * lam * draws[0].normal(size=70)
        np.testing.assert_allclose(made.start, guess, rtol=1e-15)
        for samples, exact, rng in (
            (made.train, train, draws[1]),
            (made.validation, held, draws[2]),
        ):
            noise = sigma * rng.normal(size=exact.tau.shape)
            np.testing.assert_allclose(samples.tau, exact.tau + noise, rtol=0, atol=1e-13)
        # Eq. 4.8 from the noisy torque of this trial.
        np.testing.assert_array_equal(made.weights, thesis_weights(made.train.tau))
        assert made.seed == draws[3].integers(2**63)


@pytest.mark.parametrize("part", ["train", "validation"])
def test_the_torque_of_the_frozen_link_counts_nowhere(
    lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray, part: str
) -> None:
    """Property: w₇ = 0, so that a poisoned torque of joint 7 changes no digit of the fit."""
    train, held, _ = (samples_of(run, lib) for run in ideal_runs)
    truth = lib.lam_from_pi(pi_true)
    problem = Problem(lib, train, held, thesis_weights(train.tau), 1.05 * truth, seed=1)
    own = getattr(problem, part)
    tau = own.tau.copy()
    tau[:, 6] += 1e3 * np.random.default_rng(0).normal(size=len(tau))
    poisoned = replace(problem, **{part: replace(own, tau=tau)})
    preset = Preset(AdamOptions(1e-3), StoppingRule(30, 5), 64)
    fits = [fit_frozen(each, truth, preset, []) for each in (problem, poisoned)]
    np.testing.assert_array_equal(fits[0].pi, fits[1].pi)
    assert fits[0].trace == fits[1].trace
    assert fits[0].lam is not None
    np.testing.assert_array_equal(fits[0].lam[60:], truth[60:])
