"""Check of the order of all joints, by their limits and the gravity torque (trap 9).

    E(P) = (1 − c²)^½,  c the cosine between τ_P and the model's gravity torque at q_P

over the permutations P that keep the joints within their limits. E needs neither units nor signs.
"""

import itertools
from dataclasses import replace
from math import factorial

import numpy as np

from runtime.inspection.checks.order_scores import BEYOND, ROWS, beyond_limits, mismatches
from runtime.inspection.finding import WARNING, Finding
from runtime.library import Library
from runtime.recording import Recipe, Recording

MOST = 5040
"""Largest number of permutations that are all tried."""
GOOD, BETTER = 0.5, 0.6
"""E below which an order fits, and E of the best order over that of the present one below which
the order is changed."""


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
    best, least = orders[int(np.argmin(errors))], float(errors.min())
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
            trap=9,
        )
    ]


def _orders(n: int) -> itertools.chain | itertools.permutations:
    """All permutations of few joints; cyclic shifts, reversal and exchanges of many."""
    if factorial(n) <= MOST:
        return itertools.permutations(range(n))
    base = list(range(n))
    shifted = (tuple(base[k:] + base[:k]) for k in range(n))
    swapped = (
        tuple(b if k == a else a if k == b else k for k in base)
        for a, b in itertools.combinations(range(n), 2)
    )
    return itertools.chain(shifted, [tuple(reversed(base))], swapped)
