"""Statistics over [β; φ] → the same least squares over π alone, the linear columns eliminated.

min over φ of ‖R [K π; φ] − r‖² is ‖A π − b‖² + const: with Q₁ spanning the columns of φ, A and b
are what Q₂ᵀ leaves of R K and r (a Schur complement without normal equations). φ follows from π.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from runtime.estimators.regression import Statistics
from runtime.library import Array

RANK_TOLERANCE = 1e-9
"""Relative size below which a direction of unit columns counts as silent."""


@dataclass(frozen=True, slots=True)
class Reduced:
    """‖A π − b‖² + ρ = Σ rᵀ W r at the best φ; the mean loss is half of that over N.

    Attributes:
        factor: A, (m, 10 n).
        target: b, (m,).
        rest: ρ, what no π explains.
        count: N samples.
        freedom: equations less the columns that were determined: the ρ of unit noise.
    """

    factor: Array
    target: Array
    rest: float
    count: float
    freedom: float

    def value(self, pi: Array) -> float:
        """L at π with its best φ."""
        residual = self.factor @ pi - self.target
        return float(residual @ residual + self.rest) / (2 * self.count)

    @property
    def variance(self) -> float:
        """s² = ρ / (n N − n_b − n_φ): 1 where the weights are right."""
        return self.rest / self.freedom


@dataclass(frozen=True, slots=True)
class Elimination:
    """How φ follows from π: the linear columns' own triangle."""

    matrix: Array
    over_pi: Array
    target: Array
    order: Array
    lengths: Array

    def phi(self, pi: Array) -> Array:
        """The best φ at π, flat; a silent or repeated column gets 0."""
        phi = np.zeros(self.lengths.size)
        rank = len(self.matrix)
        if rank:
            rest = self.target - self.over_pi @ pi
            phi[self.order[:rank]] = solve_triangular(self.matrix, rest)
        return phi / self.lengths


def reduce(statistics: Statistics, joints: int) -> tuple[Reduced, Elimination]:
    """Eliminate φ.

    Args:
        statistics: of the samples; W lies in them.
        joints: equations per sample.
    """
    n_base = statistics.n_base
    columns = statistics.factor[:, n_base:]
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    over_pi = statistics.factor[:, :n_base] @ statistics.base_matrix
    target, rank = statistics.target, 0
    order, upper = np.zeros(0, dtype=int), np.zeros((0, 0))
    if lengths.size:
        q, upper, order = qr(columns / lengths, pivoting=True)
        diagonal = np.abs(np.diagonal(upper))
        rank = int(np.sum(diagonal > RANK_TOLERANCE * max(float(diagonal[0]), 1e-300)))
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
