"""Statistics over [β; φ] → the same least squares over π alone, the linear columns eliminated.

min over φ of ‖R [K π; φ] − r‖² is ‖A π − b‖² + const: with Q₁ spanning the columns of φ, A and b
are what Q₂ᵀ leaves of R K and r (a Schur complement without normal equations). φ follows from π.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.posterior import ROUNDING
from runtime.library import Array


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """Least squares over π: ‖A π − b‖² + ρ = Σ rᵀ W r at the best φ; the loss is half of it / N."""

    factor: Array  # A, (m, 10 n)
    target: Array  # b, (m,)
    rest: float  # ρ, the part that no π explains
    count: float  # N samples
    freedom: float  # equations less determined columns, the expected ρ of unit noise

    def value(self, pi: Array) -> float:
        """Mean loss L at π, (10 n,), with the best φ."""
        residual = self.factor @ pi - self.target
        return float(residual @ residual + self.rest) / (2 * self.count)

    @property
    def variance(self) -> float:
        """s² = ρ / (n N − n_b − n_φ): 1 where the weights are right."""
        return self.rest / self.freedom


def reduced_of(rows: Array, target: Array, count: int, freedom: int) -> Reduced:
    """Least squares over π of rows (m, 10 n) without friction columns, on their triangle."""
    triangle = np.asarray(np.linalg.qr(np.column_stack([rows, target]), mode="r"))
    factor, aim = np.ascontiguousarray(triangle[:-1, :-1]), np.ascontiguousarray(triangle[:-1, -1])
    return Reduced(factor, aim, float(triangle[-1, -1] ** 2), float(count), float(freedom))


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Triangular system that gives the best φ at a given π."""

    matrix: Array  # upper triangle of the determined columns, (rank, rank)
    over_pi: Array  # R K in the rows of the triangle, (rank, 10 n)
    target: Array  # r in the rows of the triangle, (rank,)
    order: Array  # columns of φ by falling pivot, (n k,)
    lengths: Array  # lengths of the columns of φ, (n k,)

    def phi(self, pi: Array) -> Array:
        """Best φ at π (10 n,), flat (n k,); a zero or dependent column gets 0."""
        phi = np.zeros(self.lengths.size)
        rank = len(self.matrix)
        if rank:
            rest = self.target - self.over_pi @ pi
            phi[self.order[:rank]] = solve_triangular(self.matrix, rest)
        return phi / self.lengths


def reduce(statistics: Statistics, joints: int) -> tuple[Reduced, Elimination]:
    """Eliminate φ from compressed samples."""
    # Columns of φ at unit length, so that one tolerance serves N·m and N·m·s alike.
    n_base = statistics.n_base
    columns = statistics.factor[:, n_base:]
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    over_pi = statistics.factor[:, :n_base] @ statistics.base_matrix
    target, rank = statistics.target, 0
    order, upper = np.zeros(0, dtype=int), np.zeros((0, 0))
    # F = Q [U; 0] with pivoting: the first rank rows of Qᵀ determine φ, the others contain no φ.
    if lengths.size:
        q, upper, order = qr(columns / lengths, pivoting=True)
        diagonal = np.abs(np.diagonal(upper))
        rank = int(np.sum(diagonal > ROUNDING * max(float(diagonal[0]), 1e-300)))
        over_pi, target = q.T @ over_pi, q.T @ target
    kept = Elimination(upper[:rank, :rank], over_pi[:rank], target[:rank], order, lengths)
    freedom = statistics.n_samples * joints - n_base - rank
    left = Reduced(
        np.ascontiguousarray(over_pi[rank:]),
        np.ascontiguousarray(target[rank:]),
        statistics.rest,
        statistics.n_samples,
        max(freedom, 1.0),
    )
    return left, kept
