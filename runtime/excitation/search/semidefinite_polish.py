"""min log cond C(x) s.t. A x ≤ b, g(x) ≤ 0 where extreme eigenvalues meet, by SDPs in turn.

At an optimum the largest and the smallest eigenvalue are multiple, log cond has a kink there and
descent along gradients stalls. Here all eigenvalues near an end move together: with V₁, V₂ the
eigenvectors near the upper and the lower end, Λ₁, Λ₂ their eigenvalues and C_i = ∂C/∂x_i, a step
d solves

    min  a − b + ½ (b − 1)² + ½ dᵀ B d
    s.t. Λ₁ + Σ d_i V₁ᵀ C_i V₁ ⪯ a λ_max,   Λ₂ + Σ d_i V₂ᵀ C_i V₂ ⪰ b λ_min,
         A (x + d) ≤ b,   |d|_∞ ≤ Δ,

and is taken when log cond itself falls (trust region); g is elastic and enters the merit, see
`conic`. B is the curvature of the Lagrangian (Overton 1988; Overton and Womersley 1995).
Independent of robots.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from runtime.excitation.search import conic
from runtime.library import Array, Indices

CLUSTER = 1.35  # eigenvalues within this factor of an extreme belong to its cluster
LARGEST_CLUSTER = 8  # largest number of eigenvalues in a cluster
_SHARPNESS = 20.0  # exponent of first weights of a cluster, by distance from the extreme
RADIUS = 0.3  # first Δ, for x that is scaled so that 1 reaches the bounds
_DIFFERENCE = 1e-4  # relative central differences of C: truncation 1e-8, rounding 1e-12
_FLATTEST = 1e-4  # smallest curvature: the model stays convex
_GOOD, _POOR, _TAKEN = 0.7, 0.3, 0.05  # true over predicted decrease: grow, shrink Δ, step


class MatrixFunction(Protocol):
    """A symmetric positive definite matrix C (m, m) that depends on x (p,)."""

    def at(self, points: Array) -> Array:
        """Matrices C at K points (K, p): (K, m, m)."""

    def slopes(self, points: Array, weight: Array) -> tuple[Array, Array]:
        """Matrices and slopes for a constant symmetric F.

        Args:
            points: (K, p).
            weight: F, (m, m).

        Returns:
            C, (K, m, m), and ∂⟨F, C⟩/∂x, (K, p).
        """


@dataclass(frozen=True, slots=True)
class Polished:
    """End of the search: x with A x ≤ b, log cond there and the merit after every step taken."""

    x: Array
    value: float
    history: tuple[float, ...]


def polish(
    matrix: MatrixFunction,
    x: Array,
    rows: conic.LinearRows,
    iterations: int = 40,
    tolerance: float = 1e-5,
    nonlinear: conic.Nonlinear | None = None,
) -> Polished:
    """Improve an x with A x ≤ b; the merit never rises."""

    def at(x: Array) -> _Point:
        spectrum = Spectrum.of(matrix.at(x[None])[0])
        return _Point(x, spectrum, 0.0 if nonlinear is None else nonlinear.violation(x))

    point, radius = at(x), RADIUS
    history = [point.merit]
    weights: tuple[Array, Array] | None = None
    model: _Model | None = None
    curved: conic.Curved | None = None
    for _ in range(iterations):
        if not np.isfinite(point.merit):
            break
        if model is None:
            model = _Model.around(matrix, point.x, point.spectrum, weights)
            curved = None if nonlinear is None else conic.Curved(nonlinear, point.x)
        # Predicted decrease of the merit: of log cond, and μ times that of the violation.
        trial = model.step(point.x, rows, radius, curved)
        if trial is None:
            break
        decrease = trial.decrease
        if curved is not None:
            decrease += conic.MU * (point.violation - curved.after(trial.step))
        if decrease < tolerance:
            break
        after = at(point.x + rows.reach(point.x, trial.step) * trial.step)
        # Second-order correction of Maratos where the rows bend away: see `elastic.corrected`.
        if nonlinear is not None and point.merit - after.merit < _POOR * decrease:
            back = conic.corrected(nonlinear, after.x)
            if back is not None:
                other = at(after.x + rows.reach(after.x, back) * back)
                after = min(after, other, key=lambda one: one.merit)
        # Trust region on the ratio of true to predicted decrease. A step that is not taken keeps
        # the model: only Δ changes.
        ratio = (point.merit - after.merit) / decrease
        length = float(np.abs(trial.step).max())
        if ratio > _TAKEN:
            point, weights, model = after, trial.weights, None
            history.append(point.merit)
            if ratio > _GOOD and length > 0.9 * radius:
                radius *= 2.0
            elif ratio < _POOR:
                radius *= 0.5
        else:
            radius = 0.3 * min(radius, length)
    return Polished(point.x, point.spectrum.value, tuple(history))


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Eigenvalues, ascending, eigenvectors and log cond; inf where C is not positive definite."""

    values: Array
    vectors: Array
    value: float

    @classmethod
    def of(cls, matrix: Array) -> "Spectrum":
        """Spectrum of C (m, m)."""
        values, vectors = np.linalg.eigh(matrix)
        positive = values[0] > len(values) * np.finfo(float).eps * values[-1]
        value = float(np.log(values[-1] / values[0]) / 2) if positive else np.inf
        return cls(values, vectors, value)

    def upper(self) -> Indices:
        """Indices of the cluster at the upper end."""
        return np.flatnonzero(self.values >= self.values[-1] / CLUSTER)[-LARGEST_CLUSTER:]

    def lower(self) -> Indices:
        """Indices of the cluster at the lower end."""
        return np.flatnonzero(self.values <= self.values[0] * CLUSTER)[:LARGEST_CLUSTER]


def weight_of(at: Spectrum, cluster: Indices, extreme: float, previous: Array | None) -> Array:
    """Multipliers of a cluster, V U Vᵀ of trace 1: the previous ones, as far as they lie in it."""
    vectors = at.vectors[:, cluster]
    if previous is not None:
        inner = vectors.T @ previous @ vectors
        if np.trace(inner) > 0.5:
            return of_trace_one(vectors @ inner @ vectors.T)
    far = np.abs(np.log(at.values[cluster] / extreme))
    return of_trace_one((vectors * np.exp(-_SHARPNESS * far)) @ vectors.T)


def of_trace_one(matrix: Array) -> Array:
    """The matrix scaled to trace 1."""
    return matrix / np.trace(matrix)


def bending(slopes: Array, at: Spectrum, cluster: Indices, weight: Array, extreme: float) -> Array:
    """Second order (p, p) of a cluster through the eigenvalues outside, relative to the extreme.

    2 ⟨U, V₁ᵀ C_i V₂ (λ − Λ₂)⁻¹ V₂ᵀ C_j V₁⟩ / λ: positive at both ends, as the lower one counts
    with a minus.
    """
    # U in the basis of the cluster, V₁ᵀ C_i V₂, and λ / |λ − Λ₂|.
    outside = np.setdiff1d(np.arange(len(at.values)), cluster)
    inner = at.vectors[:, cluster].T @ weight @ at.vectors[:, cluster]
    across = slopes[:, :, outside]
    gaps = extreme / np.abs(extreme - at.values[outside])
    p = len(slopes)
    weighted = ((inner @ across) * gaps).reshape(p, -1)
    return 2 * weighted @ across.reshape(p, -1).T


@dataclass(frozen=True, slots=True)
class _Point:
    """Point x, the eigenvalues of C there and the violation v."""

    x: Array
    spectrum: Spectrum
    violation: float

    @property
    def merit(self) -> float:
        return self.spectrum.value + conic.MU * self.violation


@dataclass(frozen=True, slots=True)
class _Step:
    """A solution of the programme."""

    step: Array  # d
    decrease: float  # of log cond, by the model
    weights: tuple[Array, Array]  # duals of both ends as matrices (m, m) of trace 1


@dataclass(frozen=True, slots=True)
class _End:
    """One cluster, relative to its extreme eigenvalue."""

    vectors: Array  # V, (m, r)
    values: Array  # Λ / λ, (r,)
    slopes: Array  # Vᵀ C_i V / λ, (p, r, r)

    def block(self, sign: float, column: int, variables: int) -> conic.ConeBlock:
        """Block sign (t I − Λ − Σ d_i slopes_i) ⪰ 0 with t = x[column]."""
        r = len(self.values)
        # Clarabel wants columns of the upper triangle with √2 off the diagonal.
        j, i = np.tril_indices(r)
        size = np.where(i == j, 1.0, np.sqrt(2.0))
        a = np.zeros((len(i), variables))
        a[:, : len(self.slopes)] = sign * (self.slopes[:, i, j] * size).T
        a[:, column] = -sign * (i == j)
        b = -sign * np.diag(self.values)[i, j] * size
        return conic.ConeBlock(a, b, r)

    def weight(self, dual: Array) -> Array:
        """Dual triangle as V U Vᵀ with trace 1."""
        r = len(self.values)
        j, i = np.tril_indices(r)
        u = np.zeros((r, r))
        u[i, j] = u[j, i] = dual / np.where(i == j, 1.0, np.sqrt(2.0))
        return of_trace_one(self.vectors @ u @ self.vectors.T)


@dataclass(frozen=True, slots=True)
class _Model:
    """The programme at one point."""

    curvature: Array  # B, (p, p)
    upper: _End  # upper, lower: both ends of the spectrum
    lower: _End

    @classmethod
    def around(
        cls, matrix: MatrixFunction, x: Array, at: Spectrum, weights: tuple[Array, Array] | None
    ) -> "_Model":
        # Multipliers of both clusters: the duals of the last step, where they lie in them.
        """Model of C near x by central differences."""
        high, low = at.upper(), at.lower()
        first = weight_of(at, high, at.values[-1], None if weights is None else weights[0])
        second = weight_of(at, low, at.values[0], None if weights is None else weights[1])
        p = len(x)
        # C_i, and B as the second derivative of ⟨F, C⟩ with F = W₁/λ_max − W₂/λ_min.
        moves = _DIFFERENCE * np.vstack([np.eye(p), -np.eye(p)])
        seed = first / at.values[-1] - second / at.values[0]
        matrices, gradients = matrix.slopes(x + moves, seed)
        slopes = (matrices[:p] - matrices[p:]) / (2 * _DIFFERENCE)
        curvature = (gradients[:p] - gradients[p:]) / (2 * _DIFFERENCE)
        # In the basis of all eigenvectors: rows of the ends, all columns.
        upper = _rotated(slopes, at.vectors[:, high], at.vectors) / at.values[-1]
        lower = _rotated(slopes, at.vectors[:, low], at.vectors) / at.values[0]
        # The second order through the eigenvalues outside the clusters (Overton).
        curvature += bending(upper, at, high, first, at.values[-1])
        curvature += bending(lower, at, low, second, at.values[0])
        top = _End(at.vectors[:, high], at.values[high] / at.values[-1], upper[:, :, high])
        bottom = _End(at.vectors[:, low], at.values[low] / at.values[0], lower[:, :, low])
        return cls(_convex(curvature), top, bottom)

    def step(
        self, x: Array, rows: conic.LinearRows, radius: float, curved: conic.Curved | None = None
    ) -> _Step | None:
        """Solution of the programme of the module's head, with μ t for the curved rows."""
        # Variables: d (p), a, b, and t with curved rows.
        p = len(x)
        size = p + 2 if curved is None else p + 3
        quadratic = np.zeros((size, size))
        quadratic[:p, :p] = self.curvature
        quadratic[p + 1, p + 1] = 1.0
        linear = np.zeros(size)
        # The programme's value is twice that of log cond, half of log λ_max/λ_min.
        linear[p:] = (1.0, -2.0) if curved is None else (1.0, -2.0, 2 * conic.MU)
        box = np.hstack([np.vstack([np.eye(p), -np.eye(p)]), np.zeros((2 * p, size - p))])
        region = conic.ConeBlock(box, np.full(2 * p, radius))
        fixed = [region, self.upper.block(1.0, p, size), self.lower.block(-1.0, p + 1, size)]

        def programme(a: Array, slack: Array) -> tuple[Array, list[Array]] | None:
            limits = conic.ConeBlock(np.hstack([a, np.zeros((len(a), size - p))]), slack)
            elastic = [] if curved is None else [curved.block(size)]
            return conic.solve(quadratic, linear, [limits, *fixed, *elastic])

        solution = rows.solve(x, programme, None if curved is None else curved.grow)
        if solution is None:
            return None
        y, duals = solution
        y = y[: p + 2]
        # At d = 0, a = b = 1 the programme's value is −½.
        value = linear[: p + 2] @ y + 0.5 * y @ quadratic[: p + 2, : p + 2] @ y
        weights = self.upper.weight(duals[2]), self.lower.weight(duals[3])
        return _Step(y[:p], float(-(0.5 + value) / 2), weights)


def _rotated(slopes: Array, left: Array, right: Array) -> Array:
    """Products leftᵀ C_i right, (p, r, m)."""
    return left.T @ slopes @ right


def _convex(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return (vectors * np.maximum(values, _FLATTEST)) @ vectors.T
