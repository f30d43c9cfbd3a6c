"""Error of an estimate beyond the posterior covariance, from data with hardly any prior.

    π_v, C_v:  mean and covariance of ‖A π − b‖² / S + ‖π − π0‖²_B,   B at round bodies

A Gaussian prior of unknown quality, 100 % of every direction of bodies as large as those of the
URDF but round, moves only what the data leave undetermined. It has no boundary, and it does not
confine a link that is thin in the URDF. With d = π̂ − π_v an estimate π̂ has the mean squared error
C + d dᵀ. C is the posterior covariance for the most probable model, and C_v for other methods.
Source: bias and variance of an estimate; Hausman 1978 for the comparison of an efficient estimator
with one that holds under weaker assumptions.
"""

import numpy as np
from scipy.linalg import block_diag

from runtime.estimators.convex import NONE, Prior
from runtime.library import Array, Library

ROUND = 1 / 3
"""Smallest eigenvalue of Σ_com over their sum of a round body."""


def vague_posterior(lib: Library, prior: Prior, rows: Array, target: Array) -> tuple[Array, Array]:
    """Mean and root of the covariance of π with a Gaussian prior of unknown quality.

    rows (m, 10 n), target (m,) → (10 n,).
    """
    # R Rᵀ = B⁻¹ / κ; with π = π0 + R z the information on z is 1 + (Ã R)ᵀ(Ã R).
    around = lib.nearest_realisable(prior.centre, ROUND)
    shrink = block_diag(*prior.bodies.spread(around)) / np.sqrt(NONE)
    left, sizes, turn = np.linalg.svd(rows @ shrink)
    count = sizes.size
    z = sizes / (1 + sizes**2) * (left.T @ (target - rows @ prior.centre))[:count]
    width = np.ones(len(turn))
    width[:count] = 1 / np.sqrt(1 + sizes**2)
    return prior.centre + shrink @ (turn[:count].T @ z), shrink @ turn.T * width
