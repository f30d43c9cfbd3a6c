"""Triangular factor of all samples, with merging and forgetting.

Factors of several logs add up, and old samples can be forgotten (Golub & Van Loan, Sec. 6.5).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.regression.posterior import least_squares
from runtime.library import Array

EXPLAINED = 1e-9
"""Remainder of a column of length one below which other columns explain it."""


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """Compressed samples of one robot: all that least squares needs of them."""

    # R over [β; φ], (p, p), p = n_b + n k; friction φ joint by joint. With the columns of φ first
    # it is upper triangular with a diagonal ≥ 0
    factor: Array
    target: Array  # r, (p,)
    rest: float  # ρ, the part that no parameters explain
    n_samples: float  # N, or the sum of the sample weights
    base_matrix: Array  # K in β = K π, (n_b, 10 n)
    model_hash: str  # of the library

    @property
    def n_base(self) -> int:
        """Number n_b of base parameters; the columns after them are those of φ."""
        return len(self.base_matrix)

    def residual(self, pi: Array, phi: Array) -> Array:
        """Residual R [K π; φ] − r: pi (10 n,), phi (n, k) → (p,)."""
        return self.factor @ np.concatenate([self.base_matrix @ pi, phi.ravel()]) - self.target

    def value(self, pi: Array, phi: Array) -> float:
        """Mean loss L = (‖R [K π; φ] − r‖² + ρ) / 2 N: pi (10 n,), phi (n, k)."""
        residual = self.residual(pi, phi)
        return float((residual @ residual + self.rest) / (2 * self.n_samples))

    def over_pi(self) -> Array:
        """Columns of R over [π; φ], (p, 10 n + n k)."""
        base = self.factor[:, : self.n_base]
        return np.hstack([base @ self.base_matrix, self.factor[:, self.n_base :]])

    def unit_columns(self) -> tuple[Array, Array]:
        """Columns of R over [β; φ] at length one, (p, p), and their lengths, (p,).

        A zero column stays zero, with a length of one.
        """
        lengths = np.linalg.norm(self.factor, axis=0)
        lengths = np.where(lengths > 0, lengths, 1.0)
        return self.factor / lengths, lengths

    def explained(self) -> NDArray[np.bool_]:
        """Columns of φ that base parameters explain, zero columns included, (n k,)."""
        matrix, _ = self.unit_columns()
        _, rest = least_squares(matrix[:, : self.n_base], matrix[:, self.n_base :])
        return np.asarray(np.linalg.norm(rest, axis=0) <= EXPLAINED)

    def condition(self) -> float | None:
        """Condition number of the columns at length one; None where the matrix is singular.

        Rotors and motors that count into links are not separate unknowns.
        """
        kept = np.concatenate([np.ones(self.n_base, dtype=bool), ~self.explained()])
        sigma = np.linalg.svd(self.unit_columns()[0][:, kept], compute_uv=False)
        return float(sigma[0] / sigma[-1]) if sigma[-1] > 1e-14 * sigma[0] else None

    def without(self, columns: NDArray[np.bool_]) -> "Statistics":
        """Statistics with some columns of φ, (n k,), set to zero."""
        kept = np.concatenate([np.ones(self.n_base, dtype=bool), ~columns])
        return replace(self, factor=np.where(kept, self.factor, 0.0))

    def holding(self, held: NDArray[np.bool_], values: Array) -> "Statistics":
        """Statistics in which some entries of φ are fixed at given values.

        held (n k,), values (n k,).
        """
        columns = self.factor[:, self.n_base :]
        shifted = replace(self, target=self.target - columns[:, held] @ values[held])
        return shifted.without(held)

    def merged(self, *others: "Statistics") -> "Statistics":
        """Return the statistics of these and other samples together."""
        for other in others:
            if other.model_hash != self.model_hash or other.factor.shape != self.factor.shape:
                raise IdentificationError(
                    "expected statistics of one robot with equally many friction columns, got "
                    f"{_identity(self)} and {_identity(other)}; compress both with one library"
                )
        parts = (self, *others)
        triangle = joined(np.stack([part.triangle() for part in parts]))
        count = sum(part.n_samples for part in parts)
        return from_triangle(triangle, count, self.base_matrix, self.model_hash)

    def scaled(self, forgetting: float) -> "Statistics":
        """Return statistics in which every sample counts `forgetting` times, 0 < forgetting ≤ 1."""
        if not 0.0 < forgetting <= 1.0:
            raise IdentificationError(
                f"expected a forgetting factor above 0 and at most 1, got {forgetting}; "
                "1 forgets nothing"
            )
        root = np.sqrt(forgetting)
        return replace(
            self,
            factor=self.factor * root,
            target=self.target * root,
            rest=self.rest * forgetting,
            n_samples=self.n_samples * forgetting,
        )

    def triangle(self) -> Array:
        """Upper triangle over [φ; β; τ], (p + 1, p + 1)."""
        size = len(self.target)
        whole = np.zeros((size + 1, size + 1))
        whole[:size, : size - self.n_base] = self.factor[:, self.n_base :]
        whole[:size, size - self.n_base : size] = self.factor[:, : self.n_base]
        whole[:size, size] = self.target
        whole[size, size] = np.sqrt(self.rest)
        return whole


def joined(parts: Array) -> Array:
    """Triangle (p, p) with a diagonal ≥ 0 of stacked rows (count, rows, p), by NumPy."""
    width = parts.shape[2]
    square = np.zeros((width, width))
    rows = parts.reshape(-1, width)
    if not np.isfinite(rows).all():
        return np.full((width, width), np.nan)
    upper = np.linalg.qr(rows, mode="r")
    square[: len(upper)] = np.triu(upper)
    return square * np.where(np.diag(square) < 0, -1.0, 1.0)[:, None]


def from_triangle(triangle: Array, count: float, base: Array, model_hash: str) -> Statistics:
    """Return the statistics of a triangle (p + 1, p + 1) over [φ; β; τ]."""
    size, n_base = len(triangle) - 1, len(base)
    phi, beta = triangle[:size, : size - n_base], triangle[:size, size - n_base : size]
    return Statistics(
        factor=np.concatenate([beta, phi], axis=1),
        target=triangle[:size, size].copy(),
        rest=float(triangle[size, size] ** 2),
        n_samples=count,
        base_matrix=base,
        model_hash=model_hash,
    )


def _identity(s: Statistics) -> str:
    return f"model {s.model_hash[:12]} with {len(s.target) - s.n_base} friction coefficients"
