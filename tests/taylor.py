"""Derivative proof: the Taylor remainder |f(x + hv) − f(x) − h J v| falls as h² (Fig. 4.1)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_PER_DECADE = 2
_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class TaylorSlope:
    """Slope of log remainder over log h, and over how many decades of h it holds."""

    slope: float
    decades: float


def taylor_slope(
    f: Callable[[Array], ArrayLike],
    x: ArrayLike,
    direction: ArrayLike,
    derivative: ArrayLike,
    largest: float = 1.0,
    smallest: float = 1e-8,
) -> TaylorSlope:
    """Longest run of steps h over which the remainder falls with the slope 2 ± 0.05.

    Too large h shows the next Taylor term, too small h the rounding of f; a wrong derivative
    shows slope 1 everywhere, which makes the run empty.

    Args:
        f: the function.
        x: where.
        direction: v.
        derivative: J v.
        largest: first h tried.
        smallest: last h tried.
    """
    x, v = np.asarray(x, dtype=float), np.asarray(direction, dtype=float)
    count = round(np.log10(largest / smallest) * _PER_DECADE) + 1
    steps = np.geomspace(largest, smallest, count)
    f0, slope0 = np.asarray(f(x)), np.asarray(derivative)
    remainder = np.array(
        [np.linalg.norm(np.asarray(f(x + h * v)) - f0 - h * slope0) for h in steps]
    )
    remainder = np.maximum(remainder, np.finfo(float).tiny)
    log_h, log_r = np.log10(steps), np.log10(remainder)
    good = np.abs(np.diff(log_r) / np.diff(log_h) - 2) <= _TOLERANCE
    first = best = length = 0
    for k, is_good in enumerate([*good, False]):
        if is_good:
            continue
        if k - first > length:
            best, length = first, k - first
        first = k + 1
    if not length:
        return TaylorSlope(float("nan"), 0.0)
    run = slice(best, best + length + 1)
    slope = float(np.polyfit(log_h[run], log_r[run], 1)[0])
    return TaylorSlope(slope, float(log_h[best] - log_h[best + length]))


def assert_second_order(measured: TaylorSlope, decades: float = 5.0) -> None:
    """The acceptance of Fig. 4.1: slope 2 ± 0.05 over at least five decades of h."""
    assert measured.decades >= decades, measured
    assert abs(measured.slope - 2) <= _TOLERANCE, measured
