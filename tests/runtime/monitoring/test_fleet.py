"""Fleet: the centre and the spread of a type, units that stand out, friction and noise."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2, kstest, multivariate_normal

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import prior_of
from runtime.library import Library
from runtime.library.parameters import links, mass
from runtime.monitoring.fleet.fleet_prior import (
    _View,
    centre_of,
    fit_fleet,
    fit_friction,
    fit_noise,
    random_effects,
)
from runtime.monitoring.fleet.gather import unit_of
from runtime.simulation.virtual_robot import perturbed
from tests.runtime.monitoring.virtual_units import (
    COULOMB,
    OF_FRICTION,
    SPREAD,
    TERMS,
    UNITS,
    VISCOUS,
    Fleet,
    statistics_about,
)


def test_the_centre_minimises_its_cost(lib: Library) -> None:
    """Derivative: the slope of κ Σ D(P_u, X) + κ_0 D(X, P_URDF) in X vanishes, to rounding.

    The matrices of a link have condition numbers of some 1e3, hence 1e-10.
    """
    rng = np.random.default_rng(0)
    urdf = lib.pseudo_inertia(prior_of(lib).centre).reshape(-1, 4, 4)
    draws = [lib.pseudo_inertia(perturbed(lib, prior_of(lib).centre, 0.3, rng)) for _ in range(3)]
    P = np.stack([each.reshape(-1, 4, 4) for each in draws])
    for kappa, kappa_0 in ((400.0, 16.0), (1.0, 16.0), (2.0, 6.0)):
        X = centre_of(P, urdf, kappa, kappa_0)
        inverse = np.linalg.inv(X)
        slope = kappa * (len(P) * inverse - inverse @ P.sum(axis=0) @ inverse)
        slope += kappa_0 * (np.linalg.inv(urdf) - inverse)
        assert np.abs(X @ slope).max() < 1e-10 * kappa * len(P)
        assert (np.linalg.eigvalsh(X) > 0).all()


def test_the_marginal_likelihood_is_that_of_the_normal_law(lib: Library, fleet: Fleet) -> None:
    """Oracle: T and −log p of SciPy's normal law with the dense covariance 1 + A H Hᵀ Aᵀ/κ."""
    unit, prior = fleet.units[0], prior_of(lib, fleet.type, floor=0.0)
    A, b = unit.factor, unit.target
    view = _View(lib, prior, A[None], b[None], prior.centre)
    for kappa in (30.0, 400.0):
        covariance = np.eye(len(A)) + A @ view.H @ view.H.T @ A.T / kappa
        rest = b - A @ lib.base_matrix @ prior.centre
        T = float(rest @ np.linalg.solve(covariance, rest))
        assert view.statistic(kappa)[0] == pytest.approx(T, rel=1e-8)
        exact = -multivariate_normal(np.zeros(len(A)), covariance).logpdf(rest)
        ours = T / 2 + np.log(1 + view.values[0] / kappa).sum() / 2
        assert ours + len(A) / 2 * np.log(2 * np.pi) == pytest.approx(exact, rel=1e-8)


def test_centre_and_spread_are_recovered(lib: Library, fleet: Fleet) -> None:
    """Oracle: κ = 1/0.05² within its interval twice as wide, T is χ², no unit stands out.

    The centre predicts units of the type better than the URDF does.
    """
    fit = fit_fleet(lib, fleet.units)
    low, high = fit.interval
    assert low**2 / fit.kappa < SPREAD**-2 < high**2 / fit.kappa
    assert fit.trust < fit.kappa
    assert not fit.stands_out.any()
    assert kstest(fit.statistic, chi2(len(lib.base_matrix)).cdf).pvalue > 1e-3
    assert (lib.relative_eigenvalues(fit.centre) > 0).all()
    assert all((lib.relative_eigenvalues(each) > 0).all() for each in fit.pi)
    known = fleet.units[0]
    A = known.factor @ lib.base_matrix
    wrong = [float(np.linalg.norm(A @ (pi - fleet.type))) for pi in (fit.centre, lib.pi0)]
    assert wrong[0] < wrong[1] / 3


def test_a_unit_with_another_tool_stands_out(
    lib: Library, fleet: Fleet, fleet_motion: Recording
) -> None:
    """Property: one unit carries 0.3 kg on link 7; it alone is named, and κ hardly moves."""
    extra = fleet.pi[4].copy()
    links(extra)[-1] += [0.3, 0.01, 0.0, 0.03, 2e-3, 2e-3, 1e-3, 0.0, 0.0, 0.0]
    odd = statistics_about(lib, fleet_motion, extra, "odd", np.random.default_rng(8))
    units = [*fleet.units[:4], unit_of(odd, lib, "odd"), *fleet.units[5:]]
    fit, without = fit_fleet(lib, units), fit_fleet(lib, fleet.units)
    assert np.flatnonzero(fit.stands_out).tolist() == [4]
    assert lib.link_names[fit.links[4]] == lib.link_names[-1]
    difference = mass(links(fit.pi[4]))[-1] - mass(links(fit.centre))[-1]
    assert 0.15 < difference < 0.45
    assert without.interval[0] < fit.kappa < without.interval[1]


def test_too_few_units_are_refused(lib: Library, fleet: Fleet) -> None:
    """Property: one sentence."""
    with pytest.raises(IdentificationError, match="at least 3 units, got 2"):
        fit_fleet(lib, fleet.units[:2])


def test_a_further_unit_lies_within_its_band() -> None:
    """Oracle: 95 % normal bands of a further value hold at least 92 % of 1000, for three spreads.

    Student's t of ten values costs a normal band 2.2 %; 1000 trials have a deviation of 0.8 %.
    """
    rng = np.random.default_rng(1)
    for tau in (0.0, 0.5, 3.0):
        inside = []
        for _ in range(1000):
            variance = rng.uniform(0.5, 2.0, size=10)
            values = 5 + tau * rng.normal(size=10) + np.sqrt(variance) * rng.normal(size=10)
            mean, sigma = random_effects(values, variance)
            inside.append(abs(5 + tau * rng.normal() - mean) < 1.96 * sigma)
        assert np.mean(inside) > 0.92 - 0.008


def test_friction_of_the_type(lib: Library, fleet: Fleet) -> None:
    """Oracle: the means of 20 units within 4 standard errors, the spread of a tenth within half."""
    fit = fit_fleet(lib, fleet.units)
    friction = fit_friction(lib, fleet.units, fit)
    assert friction.columns == TERMS.columns
    error = friction.mean - np.array([VISCOUS, COULOMB])
    assert (np.abs(error) < 4 * friction.sigma / np.sqrt(UNITS) + 0.01).all()
    assert (friction.sigma > OF_FRICTION / 2 * np.array([VISCOUS, COULOMB])).all()


def test_rounding_of_a_covariance_is_no_variance(lib: Library, fleet: Fleet) -> None:
    """Property: where large slopes make the rounding of C_β negative, the variance of φ remains."""
    fit, size = fit_fleet(lib, fleet.units[:3]), len(lib.base_matrix)
    units = [dataclasses.replace(unit, friction=unit.friction.copy()) for unit in fleet.units[:3]]
    for unit in units:
        unit.friction[..., 1:-1] = 1.0
    exact = dataclasses.replace(fit, covariance=np.zeros((3, size, size)))
    below = dataclasses.replace(fit, covariance=np.stack([-1e3 * np.eye(size)] * 3))
    np.testing.assert_array_equal(
        fit_friction(lib, units, below).sigma, fit_friction(lib, units, exact).sigma
    )


def test_noise_of_the_type(lib: Library, fleet: Fleet) -> None:
    """Oracle: medians of the units that count and state their noise; None where two do."""
    rng = np.random.default_rng(3)
    sigma = rng.uniform(0.1, 0.2, size=(UNITS, lib.n_joints))
    density = rng.uniform(5.0, 20.0, size=UNITS)
    units = [
        dataclasses.replace(unit, noise=noise, density=float(level))
        for unit, noise, level in zip(fleet.units, sigma, density, strict=True)
    ]
    units[1] = fleet.units[1]  # of an older file
    out = np.arange(UNITS) == 4
    counted = ~out & (np.arange(UNITS) != 1)
    fit = dataclasses.replace(fit_fleet(lib, fleet.units[:3]), stands_out=out)
    noise = fit_noise(units, fit)
    np.testing.assert_allclose(noise.sigma, np.median(sigma[counted], axis=0), rtol=1e-15)
    assert noise.inflation == pytest.approx(np.median(density[counted]), rel=1e-15)
    assert fit_noise(units[:3], dataclasses.replace(fit, stands_out=out[:3])) is None


def test_the_first_trust_and_the_covariance_of_units(lib: Library, fleet: Fleet) -> None:
    """Oracle: the median of T is that of χ²; C = P − P Aᵀ (1 + A P Aᵀ)⁻¹ A P, by numpy."""
    prior = prior_of(lib, fleet.type, floor=0.0)
    A, b = (np.stack([getattr(u, x) for u in fleet.units[:4]]) for x in ("factor", "target"))
    view = _View(lib, prior, A, b, prior.centre)
    kappa = view.median()
    goal = chi2.median(len(lib.base_matrix))
    assert np.median(view.statistic(kappa)) == pytest.approx(goal, rel=1e-6)
    before = view.H @ view.H.T / kappa
    for rows, covariance in zip(A, view.covariance(kappa), strict=True):
        gain = np.linalg.solve(np.eye(len(rows)) + rows @ before @ rows.T, rows @ before)
        exact = before - before @ rows.T @ gain
        np.testing.assert_allclose(covariance, exact, rtol=0, atol=1e-9 * np.abs(before).max())


def test_a_unit_of_too_many_orders_of_magnitude_is_refused(lib: Library, fleet: Fleet) -> None:
    """Property: where 1 is lost beside the squares of its rows, a sentence names the unit."""
    prior = prior_of(lib, fleet.type, floor=0.0)
    A, b = (np.stack([getattr(u, x) for u in fleet.units[:2]]) for x in ("factor", "target"))
    view = _View(lib, prior, A, b, prior.centre)
    view.A[1] = 1e80 * view.A[1, 0]  # dependent rows
    with pytest.raises(IdentificationError, match="the log of unit 2 has numbers of too many"):
        view.link(1, 400.0)
