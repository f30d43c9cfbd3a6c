"""Dahl state ζ of a path: the deflection of the contact, in (−1, 1).

    dζ = (dq − |dq| ζ) dt / z_c

Source: Dahl 1976.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

_BLOCK = 64
"""Samples of one block; all blocks are stepped through side by side."""


def dahl_state(q: FloatArray, stroke: ArrayLike) -> FloatArray:
    """ζ after each step: exact for steps of one direction, ζ ← s + (ζ − s) exp(−|Δq| / z_c).

    Args:
        q: (N, n) joint positions of one path, N ≥ 1 [rad, m].
        stroke: z_c within which the contact yields, one number or (n,) [rad, m].

    Returns:
        (N, n), 0 at the first sample.
    """
    step = np.diff(q, axis=0)
    count, n = step.shape
    blocks = max(1, -(-count // _BLOCK))
    stay, gained = np.ones((blocks * _BLOCK, n)), np.zeros((blocks * _BLOCK, n))
    stay[:count] = np.exp(-np.abs(step) / stroke)
    gained[:count] = np.sign(step) * (1 - stay[:count])
    # Within a block ζ = a ζ₀ + b: all blocks step by step, then from block to block.
    a, b = stay.reshape(blocks, _BLOCK, n), gained.reshape(blocks, _BLOCK, n)
    for i in range(1, _BLOCK):
        b[:, i] += a[:, i] * b[:, i - 1]
        a[:, i] *= a[:, i - 1]
    first = np.zeros((blocks, 1, n))
    for i in range(1, blocks):
        first[i, 0] = a[i - 1, -1] * first[i - 1, 0] + b[i - 1, -1]
    zeta = (a * first + b).reshape(blocks * _BLOCK, n)[:count]
    return np.concatenate([np.zeros((1, n)), zeta])
