"""Terms of the thresholds of an observer that follow the state of the robot.

band_j is the standard deviation of the model's torque by its posterior. dry_j is twice the dry
friction of the joint at rest and for 0.1 s after a reversal, where it may act in either direction,
else 0; of friction with a memory (dahl) it is F exp(−travel / z_c), because its first state is
unknown.
Δ |dτ_j/dt| covers torque and position that lie up to a sampling step Δ apart.
"""

import numpy as np

from runtime.library import Array, Library
from runtime.monitoring.model import CHUNK, MonitoredModel
from runtime.monitoring.noise import REVERSAL_S, near
from runtime.monitoring.observer import averaged
from runtime.monitoring.observer_settings import ObserverSettings
from runtime.recording.preprocessing import segments

SLOPE_STEPS = 10
"""Samples over which the slope of the torque is taken, at least."""
BAND_HZ = 100.0
"""Rate at which the model's band is evaluated; it changes with the motion [Hz]."""


def state_terms(
    lib: Library,
    model: MonitoredModel,
    s: ObserverSettings,
    root: Array | None,
    t: Array,
    q: Array,
    dq: Array,
    tau: Array,
) -> tuple[Array, Array]:
    """Band of the model, and dry friction with timing.

    root (p, columns) [β; φ], t (N,) [s], q (N, n) [rad, m], dq (N, n) [rad/s, m/s], tau (N, n)
    [N·m, N] → (N, n) [N·m, N].
    """
    band, extra = np.zeros_like(q), np.zeros_like(q)
    for part in segments(t):
        if part.stop - part.start <= s.steps + 1:
            continue
        position, speed, torque = averaged(s, q[part], dq[part], tau[part])
        if root is not None:
            band[part][s.steps :] = _band(lib, model, s, root, position, speed)
        slow = near(t[part][s.steps :], model.is_slow(speed), 0.0, REVERSAL_S)
        extra[part][s.steps :] = slow * (2 * model.dry_friction)
        travel = np.abs(np.diff(position, axis=0, prepend=position[:1])).cumsum(axis=0)
        extra[part][s.steps :] += model.unknown_state(travel)
        lag = max(s.steps, SLOPE_STEPS)
        extra[part][s.steps + lag :] += np.abs(torque[lag:] - torque[:-lag]) / lag
    return band, extra


def _band(
    lib: Library, model: MonitoredModel, s: ObserverSettings, root: Array, q: Array, dq: Array
) -> Array:
    """σ of the model's torque, ‖(dP/dt − S) L‖ by differences over 1/BAND_HZ, (N, n)."""
    stride = max(round(s.rate_hz / BAND_HZ), 1)
    index = np.arange(0, len(q), stride)
    if len(index) < 2:
        return np.zeros_like(q)
    values = np.empty((len(index) - 1, q.shape[1]))
    size = max(CHUNK // 8, 2)
    for start in range(0, len(index) - 1, size - 1):
        taken = index[start : start + size]
        over_p, over_s = model.rows(lib, q[taken], dq[taken])
        change = np.diff(over_p, axis=0) * (s.rate_hz / stride)
        rows = change - (over_s[1:] + over_s[:-1]) / 2
        values[start : start + len(taken) - 1] = np.linalg.norm(rows @ root, axis=2)
    held = np.minimum(np.arange(len(q)) // stride, len(values) - 1)
    return np.asarray(values[held])
