"""The posterior of linear rows: estimate, covariance, absent directions and priors."""

import numpy as np
import pytest

from runtime.estimators.regression.posterior import least_squares, orthonormal, posterior_of


def rows_of(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Rows with columns of very different units, and a right-hand side."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(40, 5)) * 10.0 ** np.arange(-3, 2), rng.normal(size=40)


def test_estimate_and_covariance_are_those_of_the_normal_equations() -> None:
    """Oracle: (AᵀA)⁻¹ Aᵀ b and (AᵀA)⁻¹, one right-hand side and several."""
    rows, target = rows_of()
    fit = posterior_of(rows, target)
    C = np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(fit.mean, C @ rows.T @ target, rtol=1e-10)
    np.testing.assert_allclose(fit.root @ fit.root.T, C, rtol=1e-10)
    np.testing.assert_allclose(fit.sigma, np.sqrt(np.diag(C)), rtol=1e-10)
    np.testing.assert_allclose(fit.step(rows.T @ target), fit.mean, rtol=1e-10)
    both = np.stack([target, 2 * target], axis=1)
    np.testing.assert_allclose(posterior_of(rows, both).mean[:, 1], 2 * fit.mean, rtol=1e-12)


def test_rows_of_joints_are_those_of_all_rows() -> None:
    """Property: the form by joints gives the estimate and covariance of the flat one."""
    rng = np.random.default_rng(1)
    rows, target = rng.normal(size=(30, 3, 4)), rng.normal(size=(30, 3))
    rows[:, 1, 2:] = 0.0
    one, other = posterior_of(rows, target), posterior_of(rows.reshape(-1, 4), target.ravel())
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-10)
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-10)


def test_absent_directions_have_no_sigma_and_least_length() -> None:
    """Closed form: of two equal columns the sum is determined, neither alone."""
    rows, target = rows_of(2)
    whole = np.column_stack([rows[:, 0], rows[:, 0], rows[:, 1], np.zeros(40)])
    fit = posterior_of(whole, target)
    alone = posterior_of(rows[:, :2], target)
    assert np.isnan(fit.sigma).tolist() == [True, True, False, True]
    np.testing.assert_allclose(fit.mean[:2], alone.mean[0] / 2, rtol=1e-9)
    assert fit.mean[3] == 0.0
    assert fit.root.shape == (4, 2)
    wide = posterior_of(whole, is_wide=True).root
    assert np.linalg.norm(wide[0] - wide[1]) > 1e6 * np.linalg.norm(wide[0] + wide[1])


@pytest.mark.parametrize("count", [3, 40])
def test_a_prior_of_all_unknowns_is_bayes_rule(count: int) -> None:
    """Oracle: C = (AᵀA + (R₀R₀ᵀ)⁻¹)⁻¹ with fewer rows than unknowns and with more."""
    rows, target = (each[:count] for each in rows_of(3))
    prior = np.tril(np.random.default_rng(4).normal(size=(5, 5))) + 2 * np.eye(5)
    fit = posterior_of(rows, target, prior=prior)
    C = np.linalg.inv(rows.T @ rows + np.linalg.inv(prior @ prior.T))
    np.testing.assert_allclose(fit.covariance, C, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(fit.mean, C @ rows.T @ target, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(fit.share, np.diag(C) / np.sum(prior**2, axis=1), rtol=1e-9)
    np.testing.assert_allclose(fit.share_of(np.eye(5)), fit.share, rtol=1e-9)
    assert 0 <= fit.determined <= min(count, 5)


def test_basis_and_residual_are_orthogonal() -> None:
    """Property: QᵀQ = 1, and the residual of least squares is orthogonal to the columns."""
    rows, target = rows_of(5)
    q = orthonormal(np.column_stack([rows, rows[:, :2] @ [1.0, 2.0]]))
    np.testing.assert_allclose(q.T @ q, np.eye(5), atol=1e-12)
    _, rest = least_squares(rows, target)
    np.testing.assert_allclose(q.T @ rest, 0.0, atol=1e-12)
    np.testing.assert_allclose(rest, target - q @ (q.T @ target), atol=1e-12)
