"""Do the velocities belong to the positions?  Order and signs of dq, and jumps of one turn.

A correlation knows no unit, so dq is held against the derivative of q before any unit is asked for.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from runtime.inspection.finding import INFO, WARNING, Finding, joint_list, numbers
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import unwrap
from runtime.recording.recipes.recipe import Signal

ALIKE = 0.8
"""Correlation of dq with the derivative of q that speaks for a pair."""
GAINED = 0.2
"""What another order must gain in correlation, for speeds of one motion are alike."""


def velocity_pairs(
    recording: Recording, plan: Recipe, lib: Library
) -> tuple[Recipe, list[Finding]]:
    """Order and sign of dq, by the correlation with the derivative of q."""
    if recording.dq is None or plan.velocity is None or len(recording) < 10:
        return plan, []
    slope = np.gradient(unwrap(recording.q)[0], recording.t, axis=0)
    alike = correlation(_smooth(slope), _smooth(recording.dq))  # (joint of q, column of dq)
    _, order = linear_sum_assignment(-np.abs(alike))
    n = len(order)
    own, best = np.abs(np.diag(alike)), np.abs(alike[np.arange(n), order])
    moved = [j for j in range(n) if order[j] != j and best[j] > ALIKE]
    findings, changes = [], plan.velocity
    if len(moved) > 1 and sorted(order[moved]) == moved and (best - own)[moved].mean() > GAINED:
        final = np.arange(n)
        final[moved] = order[moved]
        changes = replace(changes, order=_composed(changes, final))
        told = ", ".join(str(k) for k in changes.order)
        findings.append(
            Finding(
                "velocity_order",
                WARNING,
                f"the velocities belong to other joints: the derivative of q is like the columns "
                f"{told} of dq (correlation {best[moved].min():.2f}, as they stand "
                f"{own[moved].max():.2f} at most); set order = [{told}] under [velocity]",
                {"order": list(map(int, changes.order)), "correlation": numbers(best)},
                trap=9,
            )
        )
        alike = alike[:, final]
    else:
        final = np.arange(n)
    against = [j for j in range(n) if alike[j, j] < -ALIKE]
    if against:
        sign = np.where(np.isin(np.arange(n), against), -1.0, 1.0)
        changes = replace(changes, sign=tuple(float(s) for s in sign * _signs(changes, n)))
        findings.append(
            Finding(
                "velocity_sign",
                WARNING,
                f"dq runs against the derivative of q at {joint_list(lib.joint_names, against)} "
                f"(correlation {min(alike[j, j] for j in against):.2f}): one of them has the wrong "
                "sign; set sign under [velocity], or under [position] where q turns the wrong way",
                {"joints": against, "correlation": numbers(np.diag(alike))},
                trap=3,
            )
        )
    return plan.replace(velocity=changes), findings


def wraps(recording: Recording) -> list[Finding]:
    """Jumps of one turn: the reader has unwrapped them and says so."""
    told = [said for said in recording.history if said.startswith("Unwrapped")]
    asked = "as the reader always does; check that these are no turns of the robot's own"
    return [Finding("wrap", INFO, f"{said[:-1]}, {asked}", trap=10) for said in told]


def correlation(a: Array, b: Array) -> Array:
    """Pearson's correlation of each column of a (N, m) with each of b (N, k), (m, k)."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    size = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)
    return np.asarray(a.T @ b / np.where(size > 0, size, np.inf))


def _smooth(values: Array, width: int = 9) -> Array:
    """Mean over a few rows, for differences of a fine clock."""
    if len(values) < 10 * width:
        return values
    sums = np.cumsum(values, axis=0)
    return np.asarray(sums[width:] - sums[:-width]) / width


def _composed(signal: Signal, order: NDArray[np.int64]) -> tuple[int, ...]:
    """`order` applied to the joints as the recipe has them."""
    own = signal.order or tuple(range(len(order)))
    return tuple(int(own[k]) for k in order)


def _signs(signal: Signal, n: int) -> Array:
    return np.broadcast_to(np.asarray(signal.sign, dtype=float), (n,))
