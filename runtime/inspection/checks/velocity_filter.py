"""Check for velocities that were computed from the positions by a low-pass filter (trap 9).

    dq_k = a dq_{k−1} + b (q_k − q_{k−1})/h_k,    b = 1 − a,    lag a h/(1 − a)

A measured velocity has noise of its own, which its past and the last step of q do not predict. The
filter delays dq, friction and Coriolis torque against q and τ; without the column, dq is
differentiated from q with the filter of the other signals.
"""

import numpy as np

from runtime.inspection.finding import WARNING, Finding, joint_list, numbers
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import unwrap
from runtime.recording.rest_speeds import STILL

EXACT = 0.1
"""Residual of the filter over that of the past of dq alone, below which dq contains q alone."""
SLOWEST, FASTEST = 0.999, 0.3
"""Range of a; a dq with less memory is hardly late."""
CLOSED = 0.05
"""Distance of the gain b/(1 − a) of a filter from 1."""
FEWEST = 200
"""Rows that the regression needs."""


def velocity_filter(
    recording: Recording, plan: Recipe, lib: Library
) -> tuple[Recipe, list[Finding]]:
    """Velocities that are a first-order filter of the differences of q.

    Measured: least squares of dq_k on dq_{k−1} and the last difference quotient of q.
    """
    if recording.dq is None or plan.velocity is None or len(recording) < FEWEST or plan.law:
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
    return plan.replace(velocity=None), [
        Finding(
            "velocity_filtered",
            WARNING,
            f"dq of {names} is not a measurement: dq[k] = {factor:.3g} dq[k-1] + {1 - factor:.3g} "
            "(q[k] - q[k-1])/h reproduces it, a low-pass of the positions that is "
            f"{1e3 * lag:.0f} ms late; the velocity is computed from q instead: leave [velocity] "
            "out of the recipe",
            {
                "factor": numbers(memory),
                "gain": numbers(gain),
                "unexplained": numbers(rest),
                "lag_s": lag,
            },
            trap=9,
        )
    ]


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
