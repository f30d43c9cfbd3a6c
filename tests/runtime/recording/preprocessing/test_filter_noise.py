"""Correlation that a low-pass filter leaves of white noise, against filtered random numbers."""

import numpy as np
import pytest

from runtime.estimators.uncertainty import filter_inflation
from runtime.recording import Preparation, Recording
from runtime.recording.preprocessing import prepare

COUNT = 40_000


@pytest.mark.parametrize(("cutoff", "order"), [(10.0, 4), (5.0, 2)])
def test_white_noise_keeps_the_share_of_the_bandwidth(cutoff: float, order: int) -> None:
    """Oracle: σ²_before / σ²_after is f_s / 2B where the rate is kept."""
    rng = np.random.default_rng(0)
    tau = rng.normal(size=(COUNT, 1))
    zero = np.zeros_like(tau)
    log = Recording(t=np.arange(COUNT) / 100.0, q=zero, dq=zero, ddq=zero, tau=tau, name="noise")
    steps = Preparation(filter="butterworth", cutoff_hz=cutoff, order=order)
    done = prepare(log, steps)
    # The variance of some 4000 independent samples is known to 2.2 %; 4 σ.
    expected = tau.var() / done.tau.var()
    assert filter_inflation(steps, 100.0) == pytest.approx(expected, rel=0.09)
    assert filter_inflation(steps, 50.0) == pytest.approx(filter_inflation(steps, 100.0) / 2)
    assert filter_inflation(Preparation(), 100.0) == 1.0
