"""Ends of a spectrum: clusters of eigenvalues, their multipliers and their second order.

This is what `polish` needs of C at one point.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.library import Array

CLUSTER = 1.35
"""Eigenvalues within this factor of an extreme belong to its cluster."""
LARGEST = 8
"""Largest number of eigenvalues in a cluster."""
_SHARPNESS = 20.0
"""Exponent of the first weights of a cluster, falling with the distance from the extreme."""


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

    def upper(self) -> NDArray[np.intp]:
        """Indices of the cluster at the upper end."""
        return np.flatnonzero(self.values >= self.values[-1] / CLUSTER)[-LARGEST:]

    def lower(self) -> NDArray[np.intp]:
        """Indices of the cluster at the lower end."""
        return np.flatnonzero(self.values <= self.values[0] * CLUSTER)[:LARGEST]


def weight_of(
    at: Spectrum, cluster: NDArray[np.intp], extreme: float, previous: Array | None
) -> Array:
    """Multipliers of a cluster, V U Vᵀ of trace 1: the previous ones, as far as they lie in it.

    previous (m, m) → (m, m).
    """
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


def bending(
    slopes: Array, at: Spectrum, cluster: NDArray[np.intp], weight: Array, extreme: float
) -> Array:
    """Second order of a cluster through the eigenvalues outside, relative to the extreme.

    2 ⟨U, V₁ᵀ C_i V₂ (λ − Λ₂)⁻¹ V₂ᵀ C_j V₁⟩ / λ: positive at both ends, as the lower one counts
    with a minus.

    slopes (p, r, m), weight (m, m) → (p, p).
    """
    # U in the basis of the cluster, V₁ᵀ C_i V₂, and λ / |λ − Λ₂|.
    outside = np.setdiff1d(np.arange(len(at.values)), cluster)
    inner = at.vectors[:, cluster].T @ weight @ at.vectors[:, cluster]
    across = slopes[:, :, outside]
    gaps = extreme / np.abs(extreme - at.values[outside])
    p = len(slopes)
    weighted = ((inner @ across) * gaps).reshape(p, -1)
    return 2 * weighted @ across.reshape(p, -1).T
