"""Interpolation of sampled signals that keeps the power of their noise.

    x(t) = Σ_k w(i − k) x_k,   w(d) = sinc(d) kaiser(d / HALF),   Σ_k w = 1

i is the fractional row of t. Linear interpolation averages two rows, which between them halves the
variance of white noise; a search for a delay then finds half a sample.
"""

import numpy as np

from runtime.recording.recording import FloatArray

HALF = 8
"""Rows on each side."""
SHAPE = 6.0
"""Parameter of the Kaiser window: the power of noise up to 0.8 of the Nyquist frequency is kept to
0.1 %."""


def interpolate(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Signals at other times, by a windowed sinc over the rows around them.

    at (M,) [s], t (N,) [s], values (N, n) → (M, n).
    """
    row = np.interp(at, t, np.arange(len(t), dtype=float))
    first = np.floor(row).astype(np.int64)
    offsets = np.arange(1 - HALF, HALF + 1)
    distance = (row - first)[:, None] - offsets
    inside = np.clip(1.0 - (distance / HALF) ** 2, 0.0, None)
    weights = np.sinc(distance) * np.i0(SHAPE * np.sqrt(inside))
    weights /= weights.sum(axis=1, keepdims=True)
    rows = np.clip(first[:, None] + offsets, 0, len(t) - 1)
    return np.asarray(np.einsum("mk,mkn->mn", weights, values[rows]))
