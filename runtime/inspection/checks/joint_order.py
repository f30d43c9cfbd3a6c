"""Check of the order of all joints, by their limits and the gravity torque.

    E(P) = (1 − c²)^½,  c the cosine between τ_P and the model's gravity torque at q_P

over the permutations P that keep the joints within their limits. E needs neither units nor signs.
"""

import itertools
from dataclasses import replace
from math import factorial

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.regression.posterior import least_squares
from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording

MOST_ORDERS = 5040
"""Largest number of permutations that are all tried."""
GOOD, BETTER = 0.5, 0.6
"""E below which an order fits, and E of the best order over that of the present one below which
the order is changed."""
BEYOND = 0.2
"""Distance beyond a limit [rad or m] that is accepted: offsets and soft limits."""
ALIKE = 0.05
"""Difference of E that decides nothing: wrist joints carry little gravity torque."""
ROWS = 60
"""Number of rows that E is computed on."""


def joint_order(recording: Recording, plan: Recipe, lib: Library) -> tuple[Recipe, list[Finding]]:
    """Order of the joints that fits limits and gravity torque much better than the present one."""
    n = lib.n_joints
    beyond = beyond_limits(recording.q, lib)
    fits = float(np.diag(beyond).max()) <= BEYOND
    take = np.linspace(0, len(recording) - 1, ROWS).astype(int)
    if recording.tau is None:
        return plan, []
    q, tau = recording.q[take], recording.tau[take]
    stands = mismatches(q, tau, np.arange(n)[None], lib)[0]
    if fits and stands < GOOD:
        return plan, []
    orders = np.array([p for p in _orders(n) if beyond[p, np.arange(n)].max() <= BEYOND])
    if not len(orders):
        return plan, []
    errors = mismatches(q, tau, orders, lib)
    # Joints along gravity carry none of it: of orders that fit alike the one that moves fewest.
    near = np.flatnonzero(errors <= errors.min() + ALIKE)
    chosen = near[np.argmin(np.sum(orders[near] != np.arange(n), axis=1))]
    best, least = orders[chosen], float(errors[chosen])
    same = np.array_equal(best, np.arange(n))
    if same or least > GOOD or (fits and least > BETTER * stands):
        return plan, []
    columns = ", ".join(map(str, best))
    reason = (
        "the present order exceeds the limits" if not fits else f"{stands:.2f} in the present order"
    )
    changes = {
        kind: replace(signal, order=tuple(int((signal.order or tuple(range(n)))[k]) for k in best))
        for kind, signal in plan.signals().items()
    }
    return plan.replace(**changes), [
        Finding(
            "joint_order",
            WARNING,
            f"the joints are in another order than in the model: with the columns {columns} "
            f"(counted from 0) limits and gravity torque fit (mismatch {least:.2f}; {reason}); "
            f"compare with the logger and set order = [{columns}] for every signal",
            {"order": best.tolist(), "mismatch": least, "mismatch_as_is": float(stands)},
        )
    ]


def _orders(n: int) -> itertools.chain | itertools.permutations:
    """All permutations of few joints; cyclic shifts, reversal and exchanges of many."""
    if factorial(n) <= MOST_ORDERS:
        return itertools.permutations(range(n))
    base = list(range(n))
    shifted = (tuple(base[k:] + base[:k]) for k in range(n))
    swapped = (
        tuple(b if k == a else a if k == b else k for k in base)
        for a, b in itertools.combinations(range(n), 2)
    )
    return itertools.chain(shifted, [tuple(reversed(base))], swapped)


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
    """E (P,) of several orders (P, n) of the joints."""
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
        _, rest = least_squares(matrix, tau)
        errors.append(np.linalg.norm(rest) / max(float(np.linalg.norm(tau)), 1e-300))
    return np.array(errors)
