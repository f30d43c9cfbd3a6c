"""Polynomials on the unit interval with the largest size of every derivative."""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval

from runtime.library import Array


class UnitPolynomial:
    """A polynomial on 0 ≤ s ≤ 1, with its derivatives and the largest size of each."""

    def __init__(self, polynomial: Polynomial) -> None:
        every = [polynomial]
        for _ in range(polynomial.degree() + 1):
            every.append(every[-1].deriv())
        self._coefficients = [one.coef for one in every]
        self._suprema = [_supremum(one) for one in every]

    def derivative(self, order: int, s: Array) -> Array:
        """Derivative of the polynomial.

        s (N,) → (N,).
        """
        k = min(order, len(self._coefficients) - 1)
        return np.asarray(polyval(s, self._coefficients[k]))

    def supremum(self, order: int) -> float:
        """Largest |d^k p/ds^k| over 0 ≤ s ≤ 1."""
        return self._suprema[min(order, len(self._suprema) - 1)]


def _supremum(polynomial: Polynomial) -> float:
    """Largest |p| over 0 ≤ s ≤ 1: at an end or where the slope vanishes."""
    turns = polynomial.deriv().roots()
    inside = turns.real[(abs(turns.imag) < 1e-6) & (turns.real > 0) & (turns.real < 1)]
    return float(np.abs(polynomial(np.concatenate([[0.0, 1.0], inside]))).max() * (1 + 1e-12))
