"""Error of the torque gains in the covariance of a payload.

    τ_measured,j = (1 + g_j) τ_j,   g_j ~ N(0, s²)
    cov π = s² Σ_j v_j v_jᵀ,   v_j = C Σ Y_kjᵀ τ_j / σ_j²,   C = (Σ Y_kᵀ W Y_k)⁻¹

with the offsets taken out of Y and τ. Against an empty run the gains act on the difference of both
torques, which is that of the payload. A wrong gain does not average out in a longer log. Source:
linear propagation of a fixed error.
"""

import numpy as np

from runtime.library import Array


def gain_covariance(
    columns: Array, torque: Array, noise: Array, shape: Array, gain_error: float
) -> Array:
    """Covariance of a payload's π by independent errors of the joints' torque gains.

    columns (N, n, 10), torque (N, n) [N·m, N], noise (n,) [N·m, N], shape (10, 10) → (10, 10).
    """
    rows = (columns - columns.mean(axis=0)) / noise[:, None]
    varying = (torque - torque.mean(axis=0)) / noise
    slopes = np.einsum("ijk,ij->jk", rows, varying) @ shape  # v_j, one row per joint
    return np.asarray(gain_error**2 * slopes.T @ slopes)
