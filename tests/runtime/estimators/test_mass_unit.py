"""Steps and thresholds of a descent in λ follow the size of the robot."""

import numpy as np
import pytest

from runtime.estimators.descent.fit import fit_adam
from runtime.estimators.problem import Problem, in_unit, mass_unit
from runtime.estimators.regression.samples import samples_of, thesis_weights
from runtime.library import load


@pytest.fixture(scope="module")
def problem(lib, ideal_runs):
    """10 s with 0.05 N·m of noise and a first guess 10 % off."""
    rng = np.random.default_rng(0)
    run = ideal_runs[0]
    s = samples_of(run.replace(tau=run.tau + 0.05 * rng.normal(size=run.tau.shape)), lib)
    start = lib.lam0 * (1 + 0.1 * rng.normal(size=lib.lam0.size))
    return Problem(lib, s, s, thesis_weights(s.tau), start)


@pytest.mark.parametrize("size", [4.0**-5, 4.0**5])
@pytest.mark.parametrize("preset", ["simulation", "real"])
def test_an_arm_of_grams_is_fitted_as_one_of_kilograms(problem, size, preset):
    """Property: masses and torques of another size give the same steps.

    In kg, m and N·m links of 3 g ended as "converged" 35 times above the optimum.
    """
    other = in_unit(problem, 1 / size)
    usual, fit = fit_adam(problem, preset), fit_adam(other, preset)
    assert fit.iterations == usual.iterations
    # Rounding of ln m, 1e-16 · 7, over some hundred steps.
    np.testing.assert_allclose(fit.pi, size * usual.pi, rtol=1e-6, atol=1e-9 * size)
    np.testing.assert_allclose(fit.trace.training, size**2 * np.array(usual.trace.training))


def test_usual_arms_keep_the_kilogram(lib, problem):
    """Property: nothing changes for the arms of the package."""
    assert mass_unit(lib, lib.pi0) == 1.0
    assert mass_unit(load("ur5e"), load("ur5e").pi0) == 1.0
    assert in_unit(problem, 1.0) is problem


def test_weights_of_a_small_arm_are_relative(problem):
    """Oracle: w of τ·s with σ·s is w of τ."""
    tau, size = problem.train.tau, 4.0**-5
    np.testing.assert_allclose(thesis_weights(size * tau, size), thesis_weights(tau), rtol=1e-14)
