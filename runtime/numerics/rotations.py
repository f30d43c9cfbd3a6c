"""Rotation matrices from fixed-axis angles."""

import numpy as np

from runtime.numerics import Array


def matrix_from_rpy(rpy: Array) -> Array:
    """R = R_z(yaw) R_y(pitch) R_x(roll), by unit quaternions.

    rpy (3,) [rad] → (3, 3).
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy / 2), np.sin(rpy / 2)
    # (x, y, z, w) of pitch · roll, then of yaw · (pitch · roll)
    x, y, z, w = cp * sr, sp * cr, -sp * sr, cp * cr
    x, y, z, w = cy * x - sy * y, cy * y + sy * x, cy * z + sy * w, cy * w - sy * z
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )
