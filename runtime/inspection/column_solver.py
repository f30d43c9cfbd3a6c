"""Least squares with some of the columns of a triangular factor, for many choices of columns.

    G_S x_S = R_Sᵀ r,   G = D RᵀR D,   x_S ← x_S + G_S⁻¹ R_Sᵀ (r − R_S x_S)

G is computed once with columns of length one (D); a choice S takes its rows and columns. The second
step removes the error of the normal equations (corrected semi-normal equations, Björck, Numerical
Methods for Least Squares Problems, Sec. 2.9.4 of the first edition).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from runtime.estimators.regression import Statistics
from runtime.inspection.cross_validation import solved
from runtime.library import Array

LEAST = 1e-10
"""1/‖G_S⁻¹‖ from which on, so with singular values of R_S D above 1e-5, the corrected estimate has
the accuracy of an orthogonal factorisation; below it the singular values decide on the rank."""
EXACT = 1e-5
"""Residual over target below which rounding, not noise, separates candidates: there the singular
values decide, whose estimate has a residual as small as rounding allows."""


@dataclass(frozen=True, slots=True)
class ColumnSolver:
    """A factor and the Gram matrix of its columns.

    Attributes:
        statistics: factor R and target r of the rows.
        gram: G, (p, p).
        lengths: of the columns, one for a column of zeros, (p,).
    """

    statistics: Statistics
    gram: Array
    lengths: Array

    def solution(self, left_out: NDArray[np.bool_]) -> Array:
        """x = argmin ‖R x − r‖² of least length in which some entries of φ are zero.

        left_out (n k,) → (p,) [β; φ].
        """
        s = self.statistics
        kept = np.concatenate([np.ones(s.n_base, dtype=bool), ~left_out])
        kept &= np.diagonal(self.gram) > 0
        chosen = np.flatnonzero(kept)
        part = self.gram[np.ix_(chosen, chosen)]
        upper, info = lapack.dpotrf(part.T, lower=False, clean=False, overwrite_a=True)
        # With a norm of one in place of ‖G_S‖, dpocon returns 1/‖G_S⁻¹‖.
        if info or lapack.dpocon(upper, 1.0)[0] < LEAST:
            return solved([s.without(left_out)])[0]
        x = np.zeros(len(kept))
        for _ in range(2):
            misfit = s.target - s.factor @ (x / self.lengths)
            slope = misfit @ s.factor / self.lengths
            x[chosen] += lapack.dpotrs(upper, slope[chosen], lower=False)[0]
        if misfit @ misfit + s.rest < EXACT**2 * (s.target @ s.target):
            return solved([s.without(left_out)])[0]
        return x / self.lengths


def column_solver(statistics: Statistics) -> ColumnSolver:
    """The solver of a factor, with its Gram matrix."""
    matrix, lengths = statistics.unit_columns()
    return ColumnSolver(statistics, matrix.T @ matrix, lengths)
