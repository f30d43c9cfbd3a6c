"""Thresholds of correlated noise for a stated rate of false alarms.

A stationary Gaussian sequence of variance σ² with the correlation ρ of neighbours crosses u = z σ
upwards at

    ν(z) = (1/Δ) ∫_{−∞}^{z} φ(x) Q((z − ρ x)/√(1 − ρ²)) dx,

whose limit for Δ → 0 is Rice's formula. z solves 2 n ν(z) = rate for both signs of n joints.
Source: Rice 1945; Leadbetter, Lindgren & Rootzén 1983, Ch. 7.
"""

import re
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from runtime.errors import IdentificationError
from runtime.library import Array

UNITS = {"second": 1.0, "minute": 60.0, "hour": 3600.0, "day": 86400.0, "week": 604800.0}
_SHORT = {"s": "second", "min": "minute", "h": "hour", "d": "day"}
_RATE = re.compile(r"\s*([0-9.eE+-]+)\s*(?:per|/)\s*([a-z]+?)s?\s*")
_POINTS = 400


@dataclass(frozen=True, slots=True)
class AlarmRate:
    """Rate of false alarms of all joints together."""

    text: str  # as the user stated it
    per_second: float  # the same [1/s]


def alarm_rate(text: str) -> AlarmRate:
    """Rate from words such as "1 per hour" or "0.5/day"."""
    match = _RATE.fullmatch(text)
    unit = "" if match is None else _SHORT.get(match[2], match[2])
    try:
        number = float(match[1]) if match else 0.0
    except ValueError:
        number = 0.0
    if unit not in UNITS or not 0 < number < 1e9:
        raise IdentificationError(
            f"expected a rate of false alarms such as '1 per hour' (units {', '.join(UNITS)}), got "
            f"'{text}'; correct the setting false_alarms"
        )
    return AlarmRate(text.strip(), number / UNITS[unit])


def crossing_rate(z: Array, correlation: Array, rate_hz: float) -> Array:
    """Rate of upward crossings of z σ by a Gaussian sequence.

    z (m,), correlation (m,) → (m,) [1/s].
    """
    rest = np.sqrt(np.maximum(1 - correlation**2, 1e-12))
    # Most of the integral lies within some of these widths below the level.
    width = np.minimum(8.0 * rest / np.maximum(1 + correlation, 1e-3) + 8.0 * rest, 40.0)
    share = (np.arange(_POINTS) + 0.5) / _POINTS
    x = z[:, None] - width[:, None] * share
    tail = ndtr((correlation[:, None] * x - z[:, None]) / rest[:, None])
    density = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
    return np.asarray(rate_hz * (density * tail).mean(axis=1) * width)


def levels(rate: float, correlation: Array, rate_hz: float) -> Array:
    """Levels z at which all joints together cross ±z σ at a stated rate.

    correlation (n,) → (n,).
    """
    each = rate / (2 * len(correlation))
    low, high = np.zeros(len(correlation)), np.full(len(correlation), 30.0)
    for _ in range(40):
        middle = (low + high) / 2
        is_rare = crossing_rate(middle, correlation, rate_hz) < each
        low, high = np.where(is_rare, low, middle), np.where(is_rare, middle, high)
    return high


def rate_by_stretches(z: Array, correlation: Array, rate_hz: float, ratios: Array) -> float:
    """Rate of crossings where the standard deviation differs from stretch to stretch."""
    scaled = np.minimum(z / np.maximum(ratios, 1e-9), 40.0)
    rho = np.broadcast_to(correlation, scaled.shape)
    rates = crossing_rate(scaled.ravel(), rho.ravel(), rate_hz).reshape(scaled.shape)
    return float(2 * rates.mean(axis=0).sum())
