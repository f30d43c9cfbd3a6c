"""What differs between days of the same healthy robot, learnt while the observer runs.

Offsets of the sensors change from day to day, and friction with the warmth of the gears. Per joint

    r_k = f_kᵀ θ + e_k,   f = (1, viscous friction, dry friction) of the model,   e ~ N(0, σ²)

with θ = (bias [N·m, N], relative changes of both) and k blocks of 0.1 s. A Kalman filter follows θ:
the bias is unknown at first and forgotten in `BIAS_S`, the friction differs by `VISCOUS` and `DRY`
and drifts as much in `WARMTH_S`. Its prediction is subtracted from r, and its variance fᵀ P f is
added to that of r in the thresholds. A block far from the prediction may be a contact and is left
out. What stays for `HOLD_BLOCKS`, or for as long as θ was followed before, is no contact but a
bias, and θ starts again. It starts in `START_BLOCKS` blocks, of which the last one sets the bias:
no contact is found in them.
"""

import numpy as np

from runtime.library import Array

BLOCK_S = 0.1
"""Length of a block [s]."""
BIAS_S = 5.0
"""Time in which a bias is followed [s]."""
VISCOUS, DRY = 0.07, 0.05
"""Relative standard deviation of viscous and dry friction between days of a healthy robot."""
WARMTH_S = 600.0
"""Time in which friction drifts by as much [s]."""
UNKNOWN_BIAS = 30.0
"""Standard deviation of the first bias in units of σ."""
OUTLIER = 3.5
"""Standard deviations from which a block may be a contact."""
HOLD_BLOCKS = 100
"""Largest number of blocks that are left out in a row: 10 s."""
START_BLOCKS = 3
"""Blocks at the start."""


def first_covariance(sigma: Array) -> Array:
    """P of θ before the first block, from σ (n,): (n, 3)."""
    ones = np.ones_like(sigma)
    return np.stack([(UNKNOWN_BIAS * sigma) ** 2, VISCOUS**2 * ones, DRY**2 * ones], axis=1)


def drift_of_block(sigma: Array) -> Array:
    """Variance that θ gains in a block, from σ (n,): (n, 3)."""
    ones = np.ones_like(sigma)
    share = BLOCK_S / WARMTH_S
    bias = (sigma * BLOCK_S / BIAS_S) ** 2
    return np.stack([bias, share * VISCOUS**2 * ones, share * DRY**2 * ones], axis=1)


def block_steps(rate_hz: float) -> int:
    """Samples of a block."""
    return max(round(BLOCK_S * rate_hz), 1)


def usual_torque(r: Array, features: Array, sigma: Array, rate_hz: float) -> tuple[Array, Array]:
    """Prediction of r from earlier blocks, and its variance.

    r (N, n) with NaN where unknown [N·m, N], features (N, n, 3), sigma (n,) → (N, n), (N, n).
    """
    usual, variance = np.zeros_like(r), np.zeros_like(r)
    known = np.flatnonzero(np.isfinite(r).all(axis=1))
    size, n = block_steps(rate_hz), r.shape[1]
    start, drift = (
        each[:, :, None] * np.eye(3) for each in (first_covariance(sigma), drift_of_block(sigma))
    )
    theta, p = np.zeros((n, 3)), start.copy()
    count, left_out = np.zeros((2, n), dtype=int)
    noise = np.maximum(sigma**2, 1e-300)
    for begin in range(0, len(known), size):
        block = known[begin : begin + size]
        f = features[block]
        usual[block] = (f * theta).sum(axis=2)
        variance[block] = np.einsum("tji,jil,tjl->tj", f, p, f)
        if len(block) < size:
            break
        mean, seen = f.mean(axis=0), r[block].mean(axis=0)
        gain = np.einsum("jil,jl->ji", p, mean)
        spread = (gain * mean).sum(axis=1) + noise
        error = seen - (mean * theta).sum(axis=1)
        is_far = (error**2 > OUTLIER**2 * spread) & (count >= START_BLOCKS)
        taken = (~is_far / spread)[:, None] * gain
        theta = theta + taken * error[:, None]
        p = p - taken[:, :, None] * gain[:, None, :] + drift
        left_out = np.where(is_far, left_out + 1, 0)
        count = count + ~is_far
        again = left_out > np.minimum(count, HOLD_BLOCKS)
        count[again] = left_out[again] = 0
        at_start = count < START_BLOCKS
        p[at_start] = start[at_start]
    return usual, variance
