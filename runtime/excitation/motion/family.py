"""Bases of motions: what each of them provides, and the record by which a user selects it.

Here: quintic B-splines on equal intervals without the outermost ones, or ending at another place.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from runtime.library import Array, Library


class Basis(Protocol):
    """A family of functions, hashable; a motion uses as many as it has coefficients per joint.

    Args:
        lib: the robot, whose kernel the cosines use.
        size: number of functions.
        t: times, (N,) s.
        duration: t_f, s.
        order: k of a derivative.
        orders: number of derivatives, the function itself included.
        s: t / t_f, (N,), 0 ≤ s ≤ 1.
    """

    def __hash__(self) -> int:
        """Motions of equal bases share tables of their functions."""
        return hash((self.name, self.zero_jerk))

    @property
    def name(self) -> str:
        """Key in `BASES`."""

    @property
    def zero_jerk(self) -> bool:
        """The third derivative is zero at both ends."""

    @property
    def is_symmetric(self) -> bool:
        """φ(s) = φ(1 − s): half of the motion determines the whole."""

    @property
    def equation(self) -> str:
        """Equation as text, for files."""

    def size(self, harmonics: int) -> int:
        """Number of functions per joint."""

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """φ_m and three time derivatives, (N, size, 4), by their derivatives by s."""
        derivatives = self.derivatives(4, size, t / duration)
        powers = duration ** -np.arange(len(derivatives), dtype=float)
        return np.moveaxis(derivatives * powers[:, None, None], 0, 2)

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """Derivatives d^k φ_m/ds^k by s, k < orders, (orders, N, size)."""

    def bound(self, order: int, size: int) -> Array:
        """Upper bounds of |d^k φ_m/ds^k| over 0 ≤ s ≤ 1, (size,)."""


@dataclass(frozen=True, slots=True)
class BasisFamily:
    """A basis as users select it."""

    name: str  # word by which a user selects it, as in trajectory files
    sentence: str  # what the functions are, for help texts
    make: Callable[[bool], Basis]  # the basis; true for a third derivative of zero at both ends


TRANSFER = "transfer"  # name of the splines that end at another place
DEGREE = 5  # of the splines: four continuous derivatives, so the jerk has a slope to bound


@dataclass(frozen=True, slots=True)
class Spline(Basis):
    """Local functions: a joint may rest while others move.

    With `arrives` they lead from home to another place: the last function is the sum of the
    outermost ones, and the only function of one is the quintic 10 s³ − 15 s⁴ + 6 s⁵. The
    coefficients are control points less home: the motion stays in their convex hull, and the last
    one is its end.
    """

    zero_jerk: bool = False
    arrives: bool = False
    is_symmetric = False

    @property
    def name(self) -> str:
        """Word in trajectory files."""
        return TRANSFER if self.arrives else "bspline"

    @property
    def equation(self) -> str:
        """Equation as text, for files."""
        gone = self._gone
        rest = f"without the first and last {gone}"
        if self.arrives:
            rest = (
                f"without the first {gone}, the last {gone} added up; the motion ends at home + a_M"
            )
        return (
            f"q = home + sum_m a_m B_m(s), s = t/t_f: clamped B-splines of degree {DEGREE} on "
            f"equal intervals of 0..1, M + {2 * gone - self.arrives} of them {rest}"
        )

    @property
    def _gone(self) -> int:
        """Splines left out at each end: a k-th derivative there needs the first k + 1 splines."""
        return 4 if self.zero_jerk else 3

    def size(self, harmonics: int) -> int:
        """Number of functions: as many splines."""
        return harmonics

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """Derivatives of piecewise polynomials; the fifth is constant between knots."""
        return np.stack([_spline(size, self._gone, k, self.arrives)(s) for k in range(orders)])

    def bound(self, order: int, size: int) -> Array:
        """Largest coefficient: a spline lies in the convex hull of its coefficients."""
        return np.asarray(np.abs(_spline(size, self._gone, order, self.arrives).c).max(axis=0))


@lru_cache(maxsize=48)
def _spline(size: int, gone: int, order: int, arrives: bool) -> BSpline:
    """Derivative d^k/ds^k of all splines but the outermost `gone` at each end.

    With `arrives` the sum of those at the upper end is the last function.
    """
    total = size + 2 * gone - arrives
    inner = np.linspace(0.0, 1.0, total - DEGREE + 1)
    knots = np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])
    unit = np.eye(total)[:, gone : gone + size]
    if arrives:
        unit[total - gone :, -1] = 1.0
    if order > DEGREE:
        return BSpline(knots, np.zeros_like(unit), DEGREE)
    spline = BSpline(knots, unit, DEGREE)
    return spline.derivative(order) if order else spline


SPLINE_FAMILY = BasisFamily("bspline", "quintic B-splines", Spline)
