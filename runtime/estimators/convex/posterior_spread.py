"""Covariance of π where data and prior meet, C = (ÃᵀÃ + κ B)⁻¹, without inverting anything.

Ã are the data's rows over their noise, B the curvature of Σ_k [tr(P0_k⁻¹ P_k) − log det P_k]. In
units of the prior the information is 1 + (Ã R)ᵀ(Ã R), R Rᵀ = (κ B)⁻¹, which has no cancellation.
Source: Bayes' rule by Laplace's approximation (MacKay 2003, Ch. 27).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from runtime.estimators.convex.bodies import Bodies
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
"""Posterior variance below this share of the prior's: the data say ten times more."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Covariance of π.

    Attributes:
        root: C = root rootᵀ, (10 n, 10 n).
        share: posterior over prior variance of every entry, (10 n,), in (0, 1].
        determined: directions of which the data say ten times more than the prior.
    """

    root: Array
    share: Array
    determined: int


def spread_of(bodies: Bodies, pi: Array, rows: Array, kappa: float) -> Spread:
    """The covariance at bodies π that exist strictly; `rows` is Ã, (m, 10 n)."""
    shrink = block_diag(*bodies.spread(pi)) / np.sqrt(kappa)
    _, said, turn = np.linalg.svd(rows @ shrink)
    left = np.ones(len(turn))
    left[: said.size] = 1 / np.sqrt(1 + said**2)
    root = np.asarray(shrink @ turn.T * left)
    share = np.minimum(np.sum(root**2, axis=1) / np.sum(shrink**2, axis=1), 1.0)
    return Spread(root, share, int(np.sum(left**2 < DETERMINED)))


def com_sigma(root: Array, pi: Array) -> list[Array | None]:
    """Standard deviation of every link's centre of mass c = (m c)/m, (3,) m; None without m."""
    roots = root.reshape(-1, N_PARAMETERS, pi.size)
    return [
        _com_deviation(body, rows) if mass(body) else None
        for body, rows in zip(links(pi), roots, strict=True)
    ]


def _com_deviation(pi: Array, root: Array) -> Array:
    """σ of c, (3,): δc = (δ(m c) − c δm) / m."""
    slope = root[FIRST_MOMENT] - np.outer(centre_of_mass(pi), root[MASS])
    return np.asarray(np.linalg.norm(slope / mass(pi), axis=1))
