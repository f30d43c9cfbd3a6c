"""Thresholds of correlated noise for a rate of false alarms."""

import numpy as np
import pytest
from scipy.signal import lfilter

from runtime.errors import IdentificationError
from runtime.monitoring.noise import alarm_rate, crossing_rate, levels, rate_by_stretches


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_crossings_of_a_sequence(correlation: float) -> None:
    """Oracle: upward crossings of 2 and 3 σ by 10⁶ simulated samples; 4 Poisson errors."""
    rng = np.random.default_rng(0)
    x = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], rng.standard_normal(1_000_000))
    for z in (2.0, 3.0):
        counted = int(np.sum((x[:-1] < z) & (x[1:] >= z)))
        expected = 1e6 * crossing_rate(np.array([z]), np.array([correlation]), 1.0)[0]
        # Crossings of a correlated sequence cluster by up to 1/(1 − ρ)^½ of a Poisson error.
        assert abs(counted - expected) < 4 * np.sqrt(expected / (1 - correlation))


def test_levels_give_the_rate() -> None:
    """Property: both signs of all joints together cross at the stated rate."""
    correlation = np.array([0.0, 0.9, 0.99, 0.9999])
    z = levels(1 / 3600, correlation, 1000.0)
    total = 2 * crossing_rate(z, correlation, 1000.0)
    np.testing.assert_allclose(total, 1 / 3600 / 4, rtol=1e-6)
    assert (levels(1 / 604800, correlation, 1000.0) > z).all()


@pytest.mark.parametrize(
    ("text", "per_hour"), [("1 per hour", 1), ("0.5/day", 0.5 / 24), ("2 per minutes", 120)]
)
def test_rates_in_words(text: str, per_hour: float) -> None:
    """Property: number and unit of time."""
    assert alarm_rate(text).per_second * 3600 == pytest.approx(per_hour, rel=1e-12)


@pytest.mark.parametrize("text", ["", "often", "0 per hour", "-1 per hour", "1e999/h", "1 per 2"])
def test_other_words_are_refused(text: str) -> None:
    """Property: one sentence with an example."""
    with pytest.raises(IdentificationError, match="1 per hour"):
        alarm_rate(text)


def test_crossings_of_stretches_that_differ() -> None:
    """Oracle: crossings of 2 × 10⁶ samples whose σ is 0.5 or 1.32 in turn; 4 Poisson errors.

    Equal stretches have the rate of one sequence.
    """
    rng = np.random.default_rng(0)
    correlation, ratios = 0.9, np.array([[0.5], [np.sqrt(1.75)]])
    x = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], rng.standard_normal(2_000_000))
    x *= np.repeat(np.tile(ratios[:, 0], 1000), 1000)
    rho = np.array([correlation])
    for z in (3.0, 4.0):
        expected = 2e6 * rate_by_stretches(np.array([z]), rho, 1.0, ratios)
        counted = int(np.sum((np.abs(x[:-1]) < z) & (np.abs(x[1:]) >= z)))
        assert abs(counted - expected) < 4 * np.sqrt(expected / (1 - correlation))
        one = 2 * crossing_rate(np.array([z]), rho, 1.0)[0]
        assert expected > 1.5 * 2e6 * one
        alike = rate_by_stretches(np.array([z]), rho, 1.0, np.ones((5, 1)))
        assert alike == pytest.approx(one, rel=1e-12)
