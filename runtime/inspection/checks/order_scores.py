"""Scores of an order of the joints that need neither units nor signs: limits, and gravity torque.

E(P) = (1 − c²)^½,  c the cosine between τ_P and the model's gravity torque at q_P
"""

import numpy as np
from numpy.typing import NDArray

from runtime.library import Array, Library

BEYOND = 0.2
"""Distance beyond a limit [rad or m] that is accepted: offsets and soft limits."""
ROWS = 60
"""Number of rows that E is computed on."""


def beyond_limits(q: Array, lib: Library) -> Array:
    """Distance by which each column exceeds the limits of each joint.

    q (N, n) [rad, m] → (columns, joints) [rad, m].
    """
    limits = lib.limits()
    low, high = q.min(axis=0)[:, None], q.max(axis=0)[:, None]
    upper = np.where(np.isfinite(limits["upper"]), limits["upper"], 4 * np.pi)
    lower = np.where(np.isfinite(limits["lower"]), limits["lower"], -4 * np.pi)
    return np.asarray(np.maximum(np.maximum(lower - low, high - upper), 0.0))


def mismatches(q: Array, tau: Array, orders: NDArray[np.int64], lib: Library) -> Array:
    """E of several orders of the joints.

    q (N, n) [rad, m], tau (N, n), orders (P, n) → (P,) [0, 1].
    """
    placed = np.moveaxis(q[:, orders], 1, 0)  # (P, N, n)
    still = np.zeros_like(placed).reshape(-1, lib.n_joints)
    gravity = lib.inverse_dynamics(placed.reshape(still.shape), still, still, lib.pi0)
    measured = np.moveaxis(tau[:, orders], 1, 0).reshape(len(orders), -1)
    if lib.manifest.springs or "known_torque" in lib.manifest.kernels:
        places = placed.reshape(still.shape)
        static = gravity + lib.known_torque(places)
        return _with_springs(measured, static, lib.spring_columns(places))
    model = gravity.reshape(len(orders), -1)
    size = np.linalg.norm(model, axis=1) * np.linalg.norm(measured, axis=1)
    cosine = np.sum(model * measured, axis=1) / np.where(size > 0, size, np.inf)
    return np.asarray(np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))


def _with_springs(measured: Array, model: Array, springs: Array) -> Array:
    """E of torques that springs of unknown stiffness explain as well."""
    columns = np.concatenate([model[..., None], springs], axis=2)
    columns = columns.reshape(*measured.shape, -1)
    errors = []
    for matrix, tau in zip(columns, measured, strict=True):
        lengths = np.linalg.norm(matrix, axis=0)
        basis, sizes, _ = np.linalg.svd(matrix / np.where(lengths > 0, lengths, 1.0), False)
        basis = basis[:, sizes > 1e-9 * max(float(sizes[0]), 1e-300)]
        rest = tau - basis @ (basis.T @ tau)
        errors.append(np.linalg.norm(rest) / max(float(np.linalg.norm(tau)), 1e-300))
    return np.array(errors)
