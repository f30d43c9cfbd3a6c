"""Functions φ of s = t/t_f that vanish at both ends with two derivatives: q = home + Σ a_m φ_m(s).

With w = 2πm and u = s(1−s):
cosine   cos ws − 1 + ½w² u² (Eqs. 3.24–3.27), its own mirror image about t_f/2: out and back
fourier  the cosines, then sin ws − w (s − 10s³ + 15s⁴ − 6s⁵)
bspline  quintic B-splines on equal intervals without the outermost ones
On request the third derivative vanishes at both ends too; the polynomials gain two degrees then.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval
from scipy.interpolate import BSpline

from runtime.errors import IdentificationError
from runtime.library import Array, Library

DEGREE = 5
"""Of the splines: four derivatives are continuous, so that the jerk has a slope to bound."""


class _Polynomial:
    """On 0 ≤ s ≤ 1, with its derivatives and the largest size of each."""

    def __init__(self, polynomial: Polynomial) -> None:
        every = [polynomial]
        for _ in range(polynomial.degree() + 1):
            every.append(every[-1].deriv())
        self._coefficients = [one.coef for one in every]
        self._suprema = [_supremum(one) for one in every]

    def derivative(self, order: int, s: Array) -> Array:
        """d^k p/ds^k."""
        k = min(order, len(self._coefficients) - 1)
        return np.asarray(polyval(s, self._coefficients[k]))

    def supremum(self, order: int) -> float:
        """Max |d^k p/ds^k|."""
        return self._suprema[min(order, len(self._suprema) - 1)]


def _supremum(polynomial: Polynomial) -> float:
    """Max |p| over 0 ≤ s ≤ 1: at an end or where the slope vanishes."""
    turns = polynomial.deriv().roots()
    inside = turns.real[(abs(turns.imag) < 1e-6) & (turns.real > 0) & (turns.real < 1)]
    return float(np.abs(polynomial(np.concatenate([[0.0, 1.0], inside]))).max() * (1 + 1e-12))


_S = Polynomial([0.0, 1.0])
_U = Polynomial([0.0, 1.0, -1.0])
_HUMPS = _Polynomial(_U**2), _Polynomial(_U**2 + 2 * _U**3)
"""Rise with curvature 2 from both ends, the second without third derivative there."""
_RAMPS = (
    _Polynomial(_S - _S**3 * Polynomial([10.0, -15.0, 6.0])),
    _Polynomial(_S - _S**4 * Polynomial([35.0, -84.0, 70.0, -20.0])),
)
"""Slope 1 at both ends; the first has the third derivative −60 there, the second none."""
_JOLT = _Polynomial(_U**3 * Polynomial([1.0, -2.0]) / 6)
"""Third derivative 1 at both ends, nothing below."""


class Basis(Protocol):
    """A family of functions; how many of it a motion uses is its coefficients' number."""

    @property
    def name(self) -> str:
        """As in `BASES`."""

    @property
    def zero_jerk(self) -> bool:
        """The third derivative is zero at both ends."""

    @property
    def is_symmetric(self) -> bool:
        """φ(s) = φ(1 − s): half of the motion tells all."""

    @property
    def equation(self) -> str:
        """For files and people."""

    def size(self, harmonics: int) -> int:
        """Functions per joint."""

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """φ_m and three time derivatives, (N, size, 4)."""

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """d^k φ_m/ds^k, k < orders, (orders, N, size), for 0 ≤ s ≤ 1."""

    def bound(self, order: int, size: int) -> Array:
        """Upper bounds of |d^k φ_m/ds^k| over 0 ≤ s ≤ 1, (size,)."""


@dataclass(frozen=True, slots=True)
class Cosine:
    """The document's: inertia, even in dq, and friction, odd in dq, are exactly orthogonal."""

    zero_jerk: bool = False
    name = "cosine"
    is_symmetric = True

    @property
    def equation(self) -> str:
        """For files and people."""
        u = "(s^2 (1-s)^2 + 2 s^3 (1-s)^3)" if self.zero_jerk else "s^2 (1-s)^2"
        return f"q = home + sum_m a_m (cos 2 pi m s - 1 + 2 pi^2 m^2 {u}), s = t/t_f"

    def size(self, harmonics: int) -> int:
        """One cosine each."""
        return harmonics

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """By the generated kernel where there is one."""
        if self.zero_jerk:
            return _in_time(self.derivatives(4, size, t / duration), duration)
        return fourier_basis(lib, size, t, duration)

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """w^k cos(ws + kπ/2) − [k = 0] + ½w² dᵏ/dsᵏ of the polynomial."""
        w = _frequencies(size)
        result = _waves(orders, w, s, 0)
        result[0] -= 1
        for k in range(orders):
            result[k] += np.multiply.outer(_HUMPS[self.zero_jerk].derivative(k, s), w**2 / 2)
        return result

    def bound(self, order: int, size: int) -> Array:
        """Wave and polynomial apart."""
        w = _frequencies(size)
        hump = _HUMPS[self.zero_jerk].supremum(order)
        return np.asarray(w**order * (2 if order == 0 else 1) + w**2 / 2 * hump)


@dataclass(frozen=True, slots=True)
class Fourier:
    """Cosines and sines: half the condition number with the same harmonics, not out and back."""

    zero_jerk: bool = False
    name = "fourier"
    is_symmetric = False

    @property
    def equation(self) -> str:
        """For files and people."""
        ramp, jolt = "s - 10 s^3 + 15 s^4 - 6 s^5", ""
        if self.zero_jerk:
            ramp = "s - 35 s^4 + 84 s^5 - 70 s^6 + 20 s^7"
            jolt = " + w^3 s^3 (1-s)^3 (1-2s) / 6"
        cosine = Cosine(self.zero_jerk).equation.removesuffix(", s = t/t_f")
        return (
            f"{cosine} + sum_m b_m (sin w s - w ({ramp}){jolt}), w = 2 pi m, s = t/t_f; "
            "the coefficients are a_1..a_M, b_1..b_M"
        )

    def size(self, harmonics: int) -> int:
        """A cosine and a sine each."""
        return 2 * harmonics

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """By the closed form."""
        del lib
        return _in_time(self.derivatives(4, size, t / duration), duration)

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """The cosines, then the sines."""
        w = _frequencies(size // 2)
        sines = _waves(orders, w, s, 1)
        for k in range(orders):
            sines[k] -= np.multiply.outer(_RAMPS[self.zero_jerk].derivative(k, s), w)
            if self.zero_jerk:
                sines[k] += np.multiply.outer(_JOLT.derivative(k, s), w**3)
        cosines = Cosine(self.zero_jerk).derivatives(orders, size // 2, s)
        return np.concatenate([cosines, sines], axis=2)

    def bound(self, order: int, size: int) -> Array:
        """Wave and polynomial apart."""
        w = _frequencies(size // 2)
        sines = w**order + w * _RAMPS[self.zero_jerk].supremum(order)
        if self.zero_jerk:
            sines += w**3 * _JOLT.supremum(order)
        return np.concatenate([Cosine(self.zero_jerk).bound(order, size // 2), sines])


@dataclass(frozen=True, slots=True)
class Spline:
    """Local functions: a joint may rest while others move."""

    zero_jerk: bool = False
    name = "bspline"
    is_symmetric = False

    @property
    def equation(self) -> str:
        """For files and people."""
        gone = self._gone
        return (
            f"q = home + sum_m a_m B_m(s), s = t/t_f: clamped B-splines of degree {DEGREE} on "
            f"equal intervals of 0..1, M + {2 * gone} of them without the first and last {gone}"
        )

    @property
    def _gone(self) -> int:
        """At each end: the k-th derivative there belongs to the first k + 1 splines."""
        return 4 if self.zero_jerk else 3

    def size(self, harmonics: int) -> int:
        """As many splines."""
        return harmonics

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """By the closed form."""
        del lib
        return _in_time(self.derivatives(4, size, t / duration), duration)

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """Piecewise polynomials; the fifth is constant between knots, at a knot the next one."""
        return np.stack([_spline(size, self._gone, k)(s) for k in range(orders)])

    def bound(self, order: int, size: int) -> Array:
        """A spline lies in the convex hull of its coefficients, so does every derivative."""
        return np.asarray(np.abs(_spline(size, self._gone, order).c).max(axis=0))


@lru_cache(maxsize=32)
def _spline(size: int, gone: int, order: int) -> BSpline:
    """d^k/ds^k of all splines but the outermost `gone` at each end."""
    total = size + 2 * gone
    inner = np.linspace(0.0, 1.0, total - DEGREE + 1)
    knots = np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])
    unit = np.eye(total)[:, gone : total - gone]
    if order > DEGREE:
        return BSpline(knots, np.zeros_like(unit), DEGREE)
    spline = BSpline(knots, unit, DEGREE)
    return spline.derivative(order) if order else spline


COSINE = Cosine()
"""The default."""
BASES: dict[str, type[Cosine] | type[Fourier] | type[Spline]] = {
    "cosine": Cosine,
    "fourier": Fourier,
    "bspline": Spline,
}


def basis_of(name: str, zero_jerk: bool = False) -> Basis:
    """The basis of this name.

    Raises:
        IdentificationError: there is none.
    """
    if name not in BASES:
        raise IdentificationError(
            f"there is no basis '{name}' of trajectories; choose from {', '.join(BASES)}"
        )
    return BASES[name](zero_jerk)


def fourier_basis(lib: Library, harmonics: int, t: Array, duration: float) -> Array:
    """The cosines' φ_m(t) and three derivatives by the generated kernel, (N, M, 4)."""
    m = np.arange(1, harmonics + 1, dtype=float)
    times, orders = np.repeat(t, harmonics), np.tile(m, len(t))
    return lib.harmonic_basis(orders, times, duration).reshape(len(t), harmonics, 4)


def _frequencies(harmonics: int) -> Array:
    return 2 * np.pi * np.arange(1, harmonics + 1, dtype=float)


def _waves(orders: int, w: Array, s: Array, sine: int) -> Array:
    """d^k/ds^k of cos ws, or of sin ws, (orders, N, M): w^k cos(ws + kπ/2)."""
    angle = np.multiply.outer(s, w)
    waves, signs = (np.cos(angle), np.sin(angle)), (1, -1, -1, 1)
    result = np.empty((orders, *angle.shape))
    for k in range(orders):
        turn = (k - sine) % 4
        np.multiply(waves[turn % 2], signs[turn] * w**k, out=result[k])
    return result


def _in_time(derivatives: Array, duration: float) -> Array:
    """d/dt from d/ds, (N, M, orders)."""
    powers = duration ** -np.arange(len(derivatives), dtype=float)
    return np.moveaxis(derivatives * powers[:, None, None], 0, 2)
