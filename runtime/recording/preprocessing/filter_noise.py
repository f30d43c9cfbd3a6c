"""Correlation that a low-pass filter leaves of white noise.

A Butterworth filter of order N, forwards and backwards, has the power gain (1 + x^2N)⁻² at
x = f/f_c and the noise bandwidth

    B = f_c ∫₀^∞ (1 + x^2N)⁻² dx = f_c Γ(1 + 1/2N) Γ(2 − 1/2N)

so that white noise at the rate f_s after it has N/N_eff = f_s / 2B.
Source: Bendat & Piersol 2010 for the noise bandwidth; the integral is a beta function.
"""

from math import gamma

from runtime.recording.settings import Preparation


def filter_inflation(steps: Preparation, rate_hz: float) -> float:
    """N / N_eff of white noise after the low-pass filter of a prepared recording."""
    if steps.filter != "butterworth" or not steps.cutoff_hz or steps.regressor != "acceleration":
        return 1.0
    half = 1 / (2 * steps.order)
    bandwidth = steps.cutoff_hz * gamma(1 + half) * gamma(2 - half)
    return max(1.0, rate_hz / (2 * bandwidth))
