"""Figures that the convex estimators state about themselves: gap, variance, active bounds, weights.

Oracles are closed forms and Monte Carlo, so that no figure is compared with its own formula.
"""

import numpy as np
import pytest

from runtime.estimators.convex.entropic_prior import CAD, prior_of
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.convex.newton import (
    ConstraintRow,
    Constraints,
    constrained,
    convex_problem,
    minimise,
)
from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import Reduced, compress, reduce
from runtime.estimators.regression.samples import Samples
from runtime.library import Library
from tests.runtime.estimators.convex.paths import follow
from tests.runtime.estimators.convex.test_convex import compressed, measured


def test_gap_of_a_problem_with_a_known_optimum(fr3: Library) -> None:
    """Oracle: L = (s·π + B)²/2 with s·π = Σ tr(P0⁻¹ P) ≥ 0 is least at P → 0.

    At weight γ the minimiser is t P0 with (B + 4 n t) + γ = γ/t, so that L − L* = 4 n γ but for
    1/B: no certificate below that is one.
    """
    prior = prior_of(fr3)
    degree, large, gamma = 4 * fr3.n_joints, 1e4, 1.0
    data = Reduced(prior.slope[None], np.array([-large]), 0.0, 1.0, 1.0)
    path = follow(data, prior, np.array([gamma]))
    excess = path.losses[-1] - large**2 / 2
    t = (path.points[-1] @ prior.slope) / degree
    # Newton ends at a decrement of 1e-3 γ, which moves t by √(2e-3 / 4 n) of itself at most.
    assert t == pytest.approx(gamma / (large + gamma), rel=0.02)
    assert excess <= path.gap
    assert path.gap == pytest.approx(degree * gamma, rel=0.02)
    assert excess >= 0.95 * path.gap


def test_variance_counts_the_friction_columns(fr3: Library) -> None:
    """Monte Carlo: s² of unit noise is 1 on average, with 35 friction columns behind 140 equations.

    62 degrees of freedom and 40 draws: σ = √(2/(62·40)) = 0.028, three of them.
    """
    columns, count = 5, 20
    variances = []
    for seed in range(40):
        s = measured(fr3, columns, seed)
        few = s.rows(slice(0, count))
        data, _ = reduce(compress(fr3, few, np.full(7, 400.0)), 7)
        variances.append(data.variance)
        assert data.freedom == count * 7 - len(fr3.base_columns) - 7 * columns
    assert np.mean(variances) == pytest.approx(1.0, abs=0.085)


def test_only_bounds_that_hold_the_estimate_are_named(fr3: Library) -> None:
    """Property: a bound that the free estimate keeps is not named, one that holds it back is.

    mX of link 7, which the data determine; distances in its standard deviation under the prior,
    (B⁻¹)₁₁^½ of the curvature B.
    """
    data, _ = reduce(compressed(fr3), 7)
    prior = prior_of(fr3)
    gamma = CAD * data.variance / data.count
    free = minimise(convex_problem(data, prior, gamma)).pi
    curvature = prior.bodies.curvature(prior.centre)[1][6]
    scale = float(np.sqrt(np.linalg.inv(curvature)[1, 1]))
    moment = np.zeros(70)
    moment[61] = 1.0
    for distance, named in ((0.5, False), (0.1, False), (-0.1, True), (-0.5, True)):
        limit = float(free[61] + distance * scale)
        bounds = Constraints(bounds=(ConstraintRow("fr3_link7.com_box", moment, limit),))
        found, notes = constrained(bounds, data, prior, gamma)
        assert found.pi[61] < limit
        assert any("fr3_link7.com_box" in note for note in notes) == named, distance


def test_weights_do_not_depend_on_the_first_ones(fr3: Library) -> None:
    """Property: weights that start a factor of 1e6 off end where those of the noise itself do.

    One pass leaves the residuals of a fit to the loud joints alone.
    """
    rng = np.random.default_rng(4)
    sigma = np.array([3.0, 3.0, 3.0, 0.01, 0.01, 0.01, 0.01])
    exact = measured(fr3, 1, 1, noise=0.0)
    tau = exact.tau + sigma * rng.normal(size=exact.tau.shape)
    data = Samples(exact.q, exact.dq, exact.ddq, tau, exact.columns)
    right, wrong = (
        fit_map(Problem(fr3, data, data, weights, fr3.lam0)).weights
        for weights in (1 / sigma**2, sigma**2)
    )
    assert right is not None
    assert wrong is not None
    # A pass takes the difference down by a factor of ten here: 1000, 4, 1.08, then 1.004. The
    # noise itself: 150 samples know σ² to √(2/150) = 12 %, four of it and the unknowns' share.
    np.testing.assert_allclose(wrong / right, 1.0, rtol=0.15)
    np.testing.assert_allclose(right * sigma**2, 1.0, rtol=0.6)
