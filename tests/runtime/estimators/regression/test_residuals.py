"""Noise, weights, autocorrelation and inflation of residuals, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from runtime.estimators.regression.samples import autocorrelation, inflation, noise, weights_from


def test_autocorrelation_is_that_about_the_mean() -> None:
    """Oracle: numpy's correlation of centred rows, whatever their offset and their unit.

    Lags beyond the log, and a joint without residual, have 0.
    """
    rest = np.random.default_rng(0).normal(size=(20, 3)) + np.array([0.0, 5.0, -50.0])
    for unit in (1.0, 1e-6):
        out = autocorrelation(unit * np.column_stack([rest, np.zeros(20)]))
        for j in range(3):
            centred = rest[:, j] - rest[:, j].mean()
            whole = np.correlate(centred, centred, "full")[20:] / (centred @ centred)
            np.testing.assert_allclose(out[:19, j], whole, atol=1e-12)
        assert not out[19:].any()
        assert not out[:, 3].any()


def test_noise_counts_what_the_unknowns_absorb() -> None:
    """Oracle: Σ r²/(N − f (n_b + n_φ)/n) by hand; at least one degree of freedom is left."""
    lib = SimpleNamespace(base_columns=range(6))
    rest = np.array([[1.0, 2.0], [2.0, 4.0], [2.0, 0.0]] * 10)
    np.testing.assert_allclose(noise(rest, lib, 4, 2.0), np.sqrt([90 / 20, 200 / 20]), rtol=1e-15)
    np.testing.assert_allclose(noise(rest[:3], lib, 4), [3.0, np.sqrt(20)], rtol=1e-15)


def test_weights_stay_finite_at_the_rounding_of_the_torque() -> None:
    """Oracle: 1/s², s at least 1e-6 of the largest RMS torque."""
    tau = np.array([[3.0, 0.1], [-3.0, 0.1]])
    np.testing.assert_allclose(weights_from(np.array([0.5, 0.0]), tau), [4, 1 / 9e-12], rtol=1e-12)


@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_inflation_is_that_of_the_weighted_power(unit: float) -> None:
    """Oracle: 1 + 2 Σ ρ of the joint that the weights leave; independent of units; at least 1."""
    rng = np.random.default_rng(1)
    rest = unit * np.column_stack([np.cumsum(rng.normal(size=200)), rng.normal(size=200)])
    rho = autocorrelation(rest).sum(axis=0)
    assert inflation(rest, np.array([1.0, 0.0])) == pytest.approx(1 + 2 * rho[0], rel=1e-12)
    power = np.var(rest, axis=0)
    both = 1 + 2 * (rho @ power) / power.sum()
    assert inflation(rest, np.ones(2)) == pytest.approx(both, rel=1e-12)
    assert inflation(np.tile([[unit], [-unit]], (50, 1)), np.ones(1)) == 1.0
    assert inflation(np.zeros((50, 2)), np.ones(2)) == 1.0
