"""Residuals r = Y π + F φ − τ, their noise per joint, and their autocorrelation.

What filtered residuals, which repeat themselves, are worth is told by `coloured_noise`.
"""

import numpy as np

from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

LAGS = 24
SILENT = 1e-6
"""Residuals below this share of the loudest joint's torque count as rounding."""


def residuals(lib: Library, samples: Samples, pi: Array, phi: Array) -> Array:
    """r (N, m), N·m or N; W of rows of power."""
    rest = samples.rigid(lib, pi) - samples.tau
    if phi.size:
        rest = rest + samples.friction(phi.reshape(samples.columns.shape[1:]))
    return rest


def noise(rest: Array, lib: Library, n_phi: int, inflation: float = 1.0) -> Array:
    """s_j (n,): RMS of the residual, corrected for what the unknowns have absorbed of it.

    Each takes up one independent sample's worth of noise, `inflation` = N/N_eff times a row's.
    """
    used = inflation * (len(lib.base_columns) + n_phi) / rest.shape[1]
    return np.asarray(np.sqrt(_power(rest) / max(len(rest) - used, 1.0)))


def weights_from(sigma: Array, tau: Array) -> Array:
    """w_j = 1/s_j², s_j kept above rounding so that an exactly explained joint stays finite."""
    loudest = float(np.sqrt(np.mean(tau**2, axis=0)).max())
    return 1 / np.maximum(sigma, SILENT * max(loudest, 1e-300)) ** 2


def autocorrelation(rest: Array, lags: int = LAGS) -> Array:
    """ρ_l per joint for l = 1 … lags, (lags, n); 0 for a joint without residual."""
    out = np.zeros((lags, rest.shape[1]))
    for j, row in enumerate(np.ascontiguousarray(rest.T)):
        centred = row - row.mean()
        power = centred @ centred
        if power > 0:
            count = min(lags, len(rest) - 1)
            out[:count, j] = [centred[k:] @ centred[:-k] / power for k in range(1, count + 1)]
    return out


def inflation(rest: Array, weights: Array) -> float:
    """1 + 2 Σ ρ_l over the joints together, by their weighted power; at least 1 (Bartlett 1946)."""
    power = weights * _power(rest - rest.mean(axis=0))
    if not power.sum() > 0:
        return 1.0
    return max(1.0, float(1 + 2 * (autocorrelation(rest).sum(axis=0) @ power) / power.sum()))


def _power(rest: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->j", rest, rest))
