"""Positions against the limits of the joints, torques against gravity: no unit, no sign is needed.

E(P) = (1 − c²)^½,  c the cosine between τ_P and the model's gravity torque at q_P
"""

import numpy as np
from numpy.typing import NDArray

from runtime.library import Array, Library

BEYOND = 0.2
"""rad or m beyond its limits that a position may be: offsets and soft limits."""
ROWS = 60
"""Rows that E is computed on."""


def beyond_limits(q: Array, lib: Library) -> Array:
    """How far column i leaves the limits of joint j, (columns, joints), rad or m."""
    limits = lib.limits()
    low, high = q.min(axis=0)[:, None], q.max(axis=0)[:, None]
    upper = np.where(np.isfinite(limits["upper"]), limits["upper"], 4 * np.pi)
    lower = np.where(np.isfinite(limits["lower"]), limits["lower"], -4 * np.pi)
    return np.asarray(np.maximum(np.maximum(lower - low, high - upper), 0.0))


def mismatches(q: Array, tau: Array, orders: NDArray[np.int64], lib: Library) -> Array:
    """E of each permutation (P, n), (P,)."""
    placed = np.moveaxis(q[:, orders], 1, 0)  # (P, N, n)
    still = np.zeros_like(placed).reshape(-1, lib.n_joints)
    gravity = lib.inverse_dynamics(placed.reshape(still.shape), still, still, lib.pi0)
    measured = np.moveaxis(tau[:, orders], 1, 0).reshape(len(orders), -1)
    model = gravity.reshape(len(orders), -1)
    size = np.linalg.norm(model, axis=1) * np.linalg.norm(measured, axis=1)
    cosine = np.sum(model * measured, axis=1) / np.where(size > 0, size, np.inf)
    return np.asarray(np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))
