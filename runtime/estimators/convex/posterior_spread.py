"""Posterior covariance of π, C = (ÃᵀÃ + κ B)⁻¹, without a matrix inverse.

Ã are the data's rows over their noise, B the curvature of Σ_k [tr(P0_k⁻¹ P_k) − log det P_k]. In
units of the prior the information is 1 + (Ã R)ᵀ(Ã R), R Rᵀ = (κ B)⁻¹, which has no cancellation.
Source: Bayes' rule by Laplace's approximation (MacKay 2003, Ch. 27).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from runtime.estimators.convex.entropic_prior import Bodies
from runtime.library import Array
from runtime.library.parameters import (
    FIRST_MOMENT,
    MASS,
    N_PARAMETERS,
    centre_of_mass,
    links,
    mass,
)

DETERMINED = 0.1
"""Posterior over prior variance below which a parameter counts as determined by the data."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Covariance of π.

    Attributes:
        root: C = root rootᵀ, (10 n, 10 n).
        share: posterior over prior variance of every entry, (10 n,), in (0, 1].
        determined: number of directions in which the data carry ten times the information of the
            prior.
        prior_root: root of the covariance of the prior alone, (10 n, 10 n).
    """

    root: Array
    share: Array
    determined: int
    prior_root: Array

    def share_of(self, matrix: Array) -> Array:
        """Posterior over prior variance of linear combinations of π, (m,), of matrix (m, 10 n)."""
        after = np.sum((matrix @ self.root) ** 2, axis=1)
        return np.asarray(after / np.sum((matrix @ self.prior_root) ** 2, axis=1))


def spread_of(bodies: Bodies, pi: Array, rows: Array, kappa: float) -> Spread:
    """Posterior covariance at strictly consistent bodies.

    Args:
        bodies: map P(π) of one body.
        pi: π, (10 n,), P_k ≻ 0.
        rows: Ã, weighted data over their noise, (m, 10 n).
        kappa: trust κ in the prior.

    Returns:
        Root of the covariance and the share of the prior in it.
    """
    # R Rᵀ = (κ B)⁻¹: in units of the prior the information is 1 + (Ã R)ᵀ(Ã R).
    shrink = block_diag(*bodies.spread(pi)) / np.sqrt(kappa)
    _, information, turn = np.linalg.svd(rows @ shrink)
    # Singular directions of Ã R keep 1/(1 + s²) of the prior variance, the others all of it.
    left = np.ones(len(turn))
    left[: information.size] = 1 / np.sqrt(1 + information**2)
    root = np.asarray(shrink @ turn.T * left)
    share = np.minimum(np.sum(root**2, axis=1) / np.sum(shrink**2, axis=1), 1.0)
    return Spread(root, share, int(np.sum(left**2 < DETERMINED)), shrink)


def com_sigma(root: Array, pi: Array) -> list[Array | None]:
    """Standard deviation of the centre of mass c = (m c)/m of every link.

    Args:
        root: C = root rootᵀ of π, (10 n, k).
        pi: π, (10 n,).

    Returns:
        σ of c per link, (3,) [m]; None for a link without mass.
    """
    roots = root.reshape(-1, N_PARAMETERS, root.shape[1])
    return [
        _com_deviation(body, rows) if mass(body) else None
        for body, rows in zip(links(pi), roots, strict=True)
    ]


def _com_deviation(pi: Array, root: Array) -> Array:
    """σ of c, (3,), of one body: δc = (δ(m c) − c δm) / m."""
    slope = root[FIRST_MOMENT] - np.outer(centre_of_mass(pi), root[MASS])
    return np.asarray(np.linalg.norm(slope / mass(pi), axis=1))
