"""Residuals r = Y π + F φ − τ, their noise per joint, and their autocorrelation.

The effective sample size of filtered residuals is estimated by `coloured_noise`.
"""

import numpy as np

from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

NORMAL_95 = 1.959963984540054
"""Half width of the two-sided 95 % interval of a normal variable in standard deviations."""
LAGS = 24
"""Lags of the autocorrelation, in samples."""
SILENT = 1e-6
"""Residual, relative to the largest RMS torque of a joint, below which it counts as rounding."""


def residuals(lib: Library, samples: Samples, pi: Array, phi: Array) -> Array:
    """Residuals r = Y π + F φ − τ.

    pi (10 n,) → (N, m) [N·m, N; W for rows of power].
    """
    rest = samples.rigid(lib, pi) - samples.tau
    if phi.size:
        rest = rest + samples.friction(phi.reshape(samples.columns.shape[1:]))
    return rest


def noise(rest: Array, lib: Library, n_phi: int, inflation: float = 1.0) -> Array:
    """Noise s_j per joint: RMS of the residual, corrected for what the unknowns have absorbed.

    Each unknown absorbs the noise of one independent sample, `inflation` times that of a row.

    rest (N, n) → (n,) [N·m, N].
    """
    used = inflation * (len(lib.base_columns) + n_phi) / rest.shape[1]
    return np.asarray(np.sqrt(_power(rest) / max(len(rest) - used, 1.0)))


def weights_from(sigma: Array, tau: Array) -> Array:
    """Weights w_j = 1/s_j², with s_j kept above rounding so that w_j stays finite.

    sigma (n,), tau (N, n) → (n,).
    """
    largest = float(np.sqrt(np.mean(tau**2, axis=0)).max())
    return 1 / np.maximum(sigma, SILENT * max(largest, 1e-300)) ** 2


def autocorrelation(rest: Array, lags: int = LAGS) -> Array:
    """Autocorrelation ρ_l of the residuals of each joint.

    rest (N, n) → (lags, n).
    """
    out = np.zeros((lags, rest.shape[1]))
    for j, row in enumerate(np.ascontiguousarray(rest.T)):
        centred = row - row.mean()
        power = centred @ centred
        if power > 0:
            out[:, j] = [centred[k:] @ centred[:-k] / power for k in range(1, lags + 1)]
    return out


def inflation(rest: Array, weights: Array) -> float:
    """Variance inflation N / N_eff = 1 + 2 Σ ρ_l of all joints together (Bartlett 1946)."""
    power = weights * _power(rest - rest.mean(axis=0))
    if not power.sum() > 0:
        return 1.0
    return max(1.0, float(1 + 2 * (autocorrelation(rest).sum(axis=0) @ power) / power.sum()))


def _power(rest: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->j", rest, rest))
