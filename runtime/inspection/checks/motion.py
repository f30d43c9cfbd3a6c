"""Checks of the velocities against the positions: order and signs of dq, jumps of one turn.

dq is compared with the derivative of q by their correlation, which needs no unit, so that this
check comes before those of the units. Velocities may be computed from the positions by a low-pass,

    dq_k = a dq_{k−1} + b (q_k − q_{k−1})/h_k,    b = 1 − a,    lag a h/(1 − a)

A measured velocity has noise of its own, which its past and the last step of q do not predict. The
filter delays dq, friction and Coriolis torque against q and τ; without the column, dq is
differentiated from q with the filter of the other signals.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from runtime.inspection.finding import INFO, WARNING, Finding, joint_list, numbers
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import unwrap
from runtime.recording.rest_speeds import STILL

ALIKE = 0.8
"""Correlation of dq with the derivative of q above which the two belong together."""
TRAVEL = 0.05
"""Travel [rad or m] from which on a joint has had a velocity."""
GAINED = 0.2
"""Correlation that another order must gain; the joint speeds of one motion resemble each other."""
EXACT = 0.1
"""Residual of the filter over that of the past of dq alone, below which dq contains q alone."""
SLOWEST, FASTEST = 0.999, 0.3
"""Range of a; a dq with less memory is hardly late."""
CLOSED = 0.05
"""Distance of the gain b/(1 − a) of a filter from 1."""
FEWEST_ROWS = 200
"""Rows that the regression needs."""


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
    present, best = np.abs(np.diag(alike)), np.abs(alike[np.arange(n), order])
    moved = [j for j in range(n) if order[j] != j and best[j] > ALIKE]
    findings, changes = [], plan.velocity
    if len(moved) > 1 and sorted(order[moved]) == moved and (best - present)[moved].mean() > GAINED:
        final = np.arange(n)
        final[moved] = order[moved]
        present_order = changes.order or tuple(range(n))
        changes = replace(changes, order=tuple(int(present_order[k]) for k in final))
        columns = ", ".join(str(k) for k in changes.order)
        sentence = (
            f"the velocities belong to other joints: the derivative of q matches the columns "
            f"{columns} of dq (correlation {best[moved].min():.2f}, in the present order "
            f"{present[moved].max():.2f} at most); set order = [{columns}] under [velocity]"
        )
        evidence = {"order": list(map(int, changes.order)), "correlation": numbers(best)}
        findings.append(Finding("velocity_order", WARNING, sentence, evidence))
        alike = alike[:, final]
    else:
        final = np.arange(n)
    against = [j for j in range(n) if alike[j, j] < -ALIKE]
    if against:
        sign = np.where(np.isin(np.arange(n), against), -1.0, 1.0) * np.asarray(changes.sign)
        changes = replace(changes, sign=tuple(map(float, sign)))
        sentence = (
            f"dq is opposite to the derivative of q at {joint_list(lib.joint_names, against)} "
            f"(correlation {min(alike[j, j] for j in against):.2f}): one of the two has the "
            "wrong sign; set sign under [velocity], or under [position] where q is reversed"
        )
        facts = {"joints": against, "correlation": numbers(np.diag(alike))}
        findings.append(Finding("velocity_sign", WARNING, sentence, facts))
    return plan.replace(velocity=changes), findings


def constant_velocity(
    recording: Recording, plan: Recipe, lib: Library
) -> tuple[Recipe, list[Finding]]:
    """Velocities that are constant although their joint moves, so that they are not measured.

    All velocities are computed from q then, unless a control law needs those of the log.
    """
    if recording.dq is None:
        return plan, []
    travel = np.ptp(unwrap(recording.q)[0], axis=0)
    dead = np.flatnonzero((np.ptp(recording.dq, axis=0) == 0.0) & (travel > TRAVEL)).tolist()
    if not dead:
        return plan, []
    names = joint_list(lib.joint_names, dead)
    computed = plan if plan.law else plan.replace(velocity=None)
    sentence = (
        f"dq of {names} keeps one value while q moves by {max(travel[dead]):.3g} rad or m: "
        "this velocity is not measured, and friction and rotor inertia of the joint are wrong; "
        "log it, leave [velocity] out of the recipe so that all velocities are computed from "
        "q, or lock the joint in the build"
    )
    evidence = {"joints": dead, "travel": numbers(travel[dead])}
    return computed, [Finding("velocity_constant", WARNING, sentence, evidence)]


def wraps(recording: Recording) -> list[Finding]:
    """Jumps of one turn that the reader has unwrapped."""
    sentences = [sentence for sentence in recording.history if sentence.startswith("Unwrapped")]
    check = "as the reader always does; check that the robot itself did not make these turns"
    return [Finding("wrap", INFO, f"{each[:-1]}, {check}") for each in sentences]


def correlation(a: Array, b: Array) -> Array:
    """Pearson's correlation (m, k) of each column of a (N, m) with each column of b (N, k)."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    size = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)
    return np.asarray(a.T @ b / np.where(size > 0, size, np.inf))


def _smooth(values: Array, width: int = 9) -> Array:
    """Moving mean over `width` rows, because differences over a short step are noisy."""
    if len(values) < 10 * width:
        return values
    sums = np.cumsum(values, axis=0)
    return np.asarray(sums[width:] - sums[:-width]) / width


def velocity_filter(
    recording: Recording, plan: Recipe, lib: Library
) -> tuple[Recipe, list[Finding]]:
    """Velocities that are a first-order filter of the differences of q.

    Measured: least squares of dq_k on dq_{k−1} and the last difference quotient of q.
    """
    if recording.dq is None or plan.velocity is None or len(recording) < FEWEST_ROWS or plan.law:
        return plan, []
    q = unwrap(recording.q)[0]
    moving = np.flatnonzero(np.ptp(q, axis=0) > STILL)
    if not moving.size:
        return plan, []
    steps = np.diff(recording.t)
    slope = np.diff(q, axis=0) / steps[:, None]
    fits = np.array([_filter(recording.dq[:, j], slope[:, j]) for j in moving])
    memory, gain, rest = fits.T
    if not ((rest < EXACT) & (memory > FASTEST) & (memory < SLOWEST)).all():
        return plan, []
    if (np.abs(gain - 1) > CLOSED).any():
        return plan, []
    factor, step = float(np.median(memory)), float(np.median(steps))
    lag = factor * step / (1 - factor)
    names = joint_list(lib.joint_names, [int(j) for j in moving])
    sentence = (
        f"dq of {names} is not a measurement: dq[k] = {factor:.3g} dq[k-1] + {1 - factor:.3g} "
        f"(q[k] - q[k-1])/h reproduces it, a low-pass of the positions that is {1e3 * lag:.0f} "
        "ms late; the velocity is computed from q instead: leave [velocity] out of the recipe"
    )
    evidence = {
        "factor": numbers(memory),
        "gain": numbers(gain),
        "unexplained": numbers(rest),
        "lag_s": lag,
    }
    return plan.replace(velocity=None), [Finding("velocity_filtered", WARNING, sentence, evidence)]


def _filter(dq: Array, slope: Array) -> tuple[float, float, float]:
    """a, b/(1 − a), and the residual over that of two past values of dq."""
    target = dq[2:]
    fitted = np.column_stack([dq[1:-1], slope[1:]])
    past = np.column_stack([dq[1:-1], dq[:-2]])
    x, left = _solved(fitted, target)
    _, innovation = _solved(past, target)
    a, b = float(x[0]), float(x[1])
    return a, b / (1 - a) if a != 1 else np.inf, left / max(innovation, 1e-300)


def _solved(rows: Array, target: Array) -> tuple[Array, float]:
    """Least squares solution and the norm of its residual."""
    x = np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0], dtype=float)
    return x, float(np.linalg.norm(target - rows @ x))
