"""Triangular factor of all samples, with merging and forgetting, and the torque loss over it.

Factors of several logs add up, and old samples can be forgotten (Golub & Van Loan, Sec. 6.5). The
weighted loss over samples or their factor is

    L(λ, φ) = (1/N) Σ ½ rᵀ W r,  r = Y π(λ) + F φ − τ (Eqs. 4.5, 4.6)

with x = [λ, ψ], φ = ψ · unit, where one unit of ψ moves the torque of its joint by as much as a
relative change of one in λ does, so that one step size serves both.

min over φ of ‖R [K π; φ] − r‖² is ‖A π − b‖² + const: with Q₁ spanning the columns of φ, A and b
are what Q₂ᵀ leaves of R K and r (a Schur complement without normal equations). φ follows from π.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np
from scipy.linalg import qr, solve_triangular

from runtime.common.records import NotNegative, Positive
from runtime.common.threads import computed_ahead, cores
from runtime.errors import IdentificationError
from runtime.estimators.regression.posterior import ROUNDING, least_squares
from runtime.estimators.regression.samples import THESIS_SIGMA, Samples, residuals
from runtime.library import Array, Integers, Library, Mask
from runtime.recording.friction.model import torque as friction_torque

EXPLAINED = 1e-9  # remainder of a column of length one below which other columns explain it


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """Compressed samples of one robot: all that least squares needs of them."""

    # R over [β; φ], (p, p), p = n_b + n k; friction φ joint by joint. With the columns of φ first
    # it is upper triangular with a diagonal ≥ 0
    factor: Array
    target: Array  # r, (p,)
    rest: NotNegative  # ρ, the part that no parameters explain
    n_samples: Positive  # N, or the sum of the sample weights
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
        """Columns of R over [β; φ] at length one, and their lengths; 1 for a zero column."""
        lengths = np.linalg.norm(self.factor, axis=0)
        lengths = np.where(lengths > 0, lengths, 1.0)
        return self.factor / lengths, lengths

    def explained(self) -> Mask:
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

    def without(self, columns: Mask) -> "Statistics":
        """Statistics with some columns of φ, (n k,), set to zero."""
        kept = np.concatenate([np.ones(self.n_base, dtype=bool), ~columns])
        return replace(self, factor=np.where(kept, self.factor, 0.0))

    def holding(self, held: Mask, values: Array) -> "Statistics":
        """Statistics in which some entries of φ, (n k,), are fixed at given values."""
        columns = self.factor[:, self.n_base :]
        return replace(self, target=self.target - columns[:, held] @ values[held]).without(held)

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
        return self.repeated(forgetting)

    def repeated(self, times: float) -> "Statistics":
        """Statistics in which every sample counts `times` times."""
        factor, target = self.factor * np.sqrt(times), self.target * np.sqrt(times)
        rest, count = self.rest * times, self.n_samples * times
        return replace(self, factor=factor, target=target, rest=rest, n_samples=count)

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


TOGETHER = 16  # number of factors that are collected before they are joined
BLOCK = 16384
"""Samples per factor, of the last one half to one and a half as many: fixed, so that the number of
threads changes nothing, and some milliseconds of work, against which joining factors and starting
threads are negligible."""
TRIED = 8
"""Blocks that find out by themselves whether rows may be multiplied; if none may, no later one
tries, which takes a twentieth of its time. Fixed, as `BLOCK`."""


class TorqueObjective:
    """L(x) and ∇L(x) over all samples or over a mini-batch."""

    def __init__(
        self, lib: Library, samples: Samples, weights: Array, unit: Array | None = None
    ) -> None:
        self.lib, self.samples, self.weights = lib, samples, weights
        self.n_lam = lib.lam0.size
        self.shape = samples.shape
        self.unit = friction_unit(samples) if unit is None else unit

    def split(self, x: Array) -> tuple[Array, Array]:
        """λ (10 n,) and φ (n, k) of x."""
        return x[: self.n_lam], x[self.n_lam :].reshape(self.shape) * self.unit

    def join(self, lam: Array, phi: Array) -> Array:
        """x = [λ, ψ], (10 n + n k,), of λ (10 n,) and φ (n, k)."""
        return np.concatenate([lam, (phi / self.unit).ravel()])

    def value_gradient(self, x: Array, rows: Integers | None = None) -> tuple[float, Array]:
        """L [(N·m)²] and ∇L (10 n + n k,) at x = [λ, ψ], of all samples or a mini-batch."""
        lam, phi = self.split(x)
        s, lib = self.samples, self.lib
        take = slice(None) if rows is None else rows
        q, dq, ddq, tau, columns = (a[take] for a in (s.q, s.dq, s.ddq, s.tau, s.columns))
        free = tau - friction_torque(columns, phi, s.coupling) if phi.size else tau
        pi = lib.pi_from_lam(lam)
        loss, slope, residual = lib.loss_gradient(q, dq, ddq, free, self.weights, pi)
        n_lam = lib.pi_adjoint(lam, slope)
        weighted = residual * self.weights
        if s.coupling is None:  # Σ_i Cᵀ W r of every coefficient, (n, k)
            n_phi = np.einsum("ijk,ij->jk", columns, weighted) * self.unit
        else:
            n_phi = s.coupling.slope(columns, weighted) * self.unit
        return loss / len(q), np.concatenate([n_lam, n_phi.ravel()]) / len(q)

    def value(self, x: Array) -> float:
        """Loss L at x over all samples."""
        lam, phi = self.split(x)
        residual = residuals(self.lib, self.samples, self.lib.pi_from_lam(lam), phi)
        return float(np.mean((residual**2) @ self.weights) / 2)


def friction_unit(samples: Samples) -> Array:
    """Units of φ, (n, k): RMS torque of the joint over RMS of the column, 1 for a zero column."""
    square, rms = np.mean(samples.tau**2, axis=0), samples.column_sizes()
    if len(rms) < len(square):  # rows that mix joints
        square = square.sum(keepdims=True)
    return np.sqrt(square + THESIS_SIGMA**2)[:, None] / np.where(rms > 0, rms, 1.0)


def compress(
    lib: Library,
    samples: Samples,
    weights: Array,
    sample_weights: Array | None = None,
    threads: int | None = None,
) -> Statistics:
    """Compress N samples; the result does not depend on `threads`, to the bit."""
    weights = _weights("weights", weights, samples.equations)
    count = float(len(samples))
    if sample_weights is not None:
        sample_weights = _weights("sample_weights", sample_weights, len(samples))
        count = float(sample_weights.sum())
    compiled = lib.compiled_statistics
    join: Callable[[Array], Array] = compiled.join if compiled else joined

    def block(start: int, products: bool = True) -> tuple[Array, int]:
        part = slice(start, start + BLOCK if start < starts[-1] else None)
        s = samples.rows(part)
        counts = None if sample_weights is None else sample_weights[part]
        # The C code evaluates Y_b itself and takes columns of one joint each.
        if compiled is None or s.coupling is not None or s.base is not None:
            return reference_triangle(lib, s, weights, counts), 0
        return compiled.triangle(s.q, s.dq, s.ddq, s.tau, s.columns, weights, counts, products)

    # One factor per block, on threads, then the factor of all factors.
    starts = range(0, max(round(len(samples) / BLOCK), 1) * BLOCK, BLOCK)
    workers = min(len(starts), threads or cores()) if len(starts) > 1 else 1

    def all_blocks(each: Callable[..., Iterable[tuple[Array, int]]]) -> list[Array]:
        done = list(each(block, starts[:TRIED]))
        products = any(multiplied for _, multiplied in done)
        done += each(lambda start: block(start, products), starts[TRIED:])
        return [triangle for triangle, _ in done]

    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            triangles = all_blocks(pool.map)
    else:
        triangles = all_blocks(map)
    triangle = triangles[0] if len(triangles) == 1 else join(np.stack(triangles))
    if not np.isfinite(triangle).all():
        raise IdentificationError(
            "the samples hold NaN, infinite or far too large values; drop those rows before "
            "compressing them"
        )
    return from_triangle(triangle, count, lib.base_matrix, lib.manifest.model_hash)


def compress_all(lib: Library, pieces: Iterable[Samples], weights: Array) -> Statistics:
    """Compress many pieces into one, with a bounded number of factors in memory."""
    source = iter(pieces)
    first = tuple(islice(source, 2))
    if len(first) == 1:  # a short log; threads take longer to start than it takes
        return compress(lib, first[0], weights)
    factors: list[Statistics] = []
    every = chain(first, source)
    for each in computed_ahead(lambda piece: compress(lib, piece, weights), every, 2 * cores()):
        factors.append(each)
        if len(factors) == TOGETHER:
            factors = [factors[0].merged(*factors[1:])]
    if not factors:
        raise IdentificationError("there are no samples to compress; use another --split")
    return factors[0].merged(*factors[1:]) if len(factors) > 1 else factors[0]


def reference_triangle(
    lib: Library, samples: Samples, weights: Array, sample_weights: Array | None
) -> Array:
    """Triangle (p + 1, p + 1) of samples by NumPy, from rows [F Y_b τ]: reference of the C code."""
    rows = np.concatenate(
        [samples.friction_rows(), samples.base_rows(lib), samples.tau[:, :, None]], axis=2
    )
    rows *= np.sqrt(weights)[:, None]
    if sample_weights is not None:
        rows *= np.sqrt(sample_weights)[:, None, None]
    return joined(rows.reshape(1, -1, rows.shape[2]))


class CompressedObjective:
    """L(x) and ∇L(x) from compressed statistics: the cost does not depend on N."""

    def __init__(self, whole: TorqueObjective, statistics: Statistics) -> None:
        self.whole, self.statistics = whole, statistics

    def value_gradient(self, x: Array) -> tuple[float, Array]:
        """L and ∇L over all samples."""
        lib, s = self.whole.lib, self.statistics
        lam, phi = self.whole.split(x)
        residual = s.residual(lib.pi_from_lam(lam), phi)
        slope = s.factor.T @ residual / s.n_samples
        n_lam = lib.pi_adjoint(lam, slope[: s.n_base] @ s.base_matrix)
        n_phi = slope[s.n_base :] * self.whole.unit.ravel()
        value = (residual @ residual + s.rest) / (2 * s.n_samples)
        return float(value), np.concatenate([n_lam, n_phi])


def _weights(name: str, values: Array, size: int) -> Array:
    """Weights (size,) as finite numbers that are at least 0."""
    weights = np.ascontiguousarray(values, dtype=float)
    if weights.shape != (size,) or not (np.isfinite(weights) & (weights >= 0)).all():
        raise IdentificationError(
            f"expected {name} of shape ({size},), finite and at least 0, got shape "
            f"{weights.shape}; use ones to weight all rows equally"
        )
    return weights


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
        return self._solved(self.target - self.over_pi @ pi)

    @property
    def slope(self) -> Array:
        """Slope ∂φ/∂π of the best φ, (n k, 10 n)."""
        return -self._solved(self.over_pi)

    @property
    def root(self) -> Array:
        """Root of the covariance of φ at known π in units of the noise, (n k, rank)."""
        return self._solved(np.eye(len(self.matrix)))

    @property
    def undetermined(self) -> Array:
        """Columns of φ that the data do not determine."""
        return self.order[len(self.matrix) :]

    def _solved(self, right: Array) -> Array:
        """φ whose determined columns give a right side (rank, …)."""
        phi = np.zeros((self.lengths.size, *right.shape[1:]))
        if len(right):
            phi[self.order[: len(right)]] = solve_triangular(self.matrix, right)
        return np.asarray((phi.T / self.lengths).T)


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
    rows, aim = (np.ascontiguousarray(each[rank:]) for each in (over_pi, target))
    return Reduced(rows, aim, statistics.rest, statistics.n_samples, max(freedom, 1.0)), kept
