"""Rows of the equations of motion that need no accelerations.

    S τ = D P β − S R β + S F φ          p = P β = M dq,  R β = ∂(T − U)/∂q       ("momentum")
    S dq·τ = D E β + S dq·F φ            T + U = E β + const                      ("energy")

D x = (x₊ − x₋)/2h and S x = (x₋ + 4 x + x₊)/6 at every instant but the first and last of a segment:
Simpson's rule over two steps, exact to h⁴. Both sides then pass the filter of the preparation,
which is linear and the same at all times, so that its cut-off may lie in the middle of the motion:
β stays the same. A rotor's column is D dq, or D dq²/2. Source: Gautier & Khalil 1988, Slotine & Li
1987 (filtered dynamics).
"""

from collections.abc import Callable, Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from runtime.errors import RecordingError
from runtime.library import Library
from runtime.recording import Friction, Recording
from runtime.recording.friction import COLUMNS, add_columns
from runtime.recording.preprocessing.segments import segments, uniform_step, without_short
from runtime.recording.recording import FloatArray

HELD = 16_000_000
"""Largest number of entries of the regressor that are held at a time (128 MB)."""
CHUNK = 256
"""Number of instants whose whole regressor is evaluated at a time, so that it stays in the cache.
"""


def smooth_motion(recording: Recording, smooth: Callable[[Recording], Recording]) -> Recording:
    """The recording with the q and dq for momentum and energy, and without ddq.

    A missing dq is the derivative of the cubic spline through the smoothed q, exact to h⁴.
    """
    data = without_short(recording.replace(ddq=None), 4)
    uniform_step(data, "go without accelerations")
    data = smooth(data)
    if data.dq is not None:
        return data
    slopes = [CubicSpline(data.t[s], data.q[s])(data.t[s], 1) for s in segments(data.t)]
    return data.replace(dq=np.concatenate(slopes)).noted("Differentiated q to dq by cubic splines.")


def balanced(
    recording: Recording, friction: tuple[Friction, ...], lib: Library, power: bool
) -> Recording:
    """Averaged torque S τ, or S dq∘τ for power, with its friction columns; the rows are not
    computed yet.
    """
    if recording.tau is None:
        raise RecordingError("rows without accelerations expect τ, but there is none; log it")
    data = recording
    if any(terms.columns for terms in friction):
        data = add_columns(data, *friction, lib=lib)
    tau = data.required("dq") * recording.tau if power else recording.tau
    changes = {"tau": _summed(data, tau)}
    if data.columns is not None:
        speeds = [_speed(data, name) for name in data.column_names]
        columns = [
            _differenced(data, speed * speed / 2 if power else speed)
            if name in COLUMNS and COLUMNS[name].is_inertial
            else _summed(data, data.columns[..., k] * speed if power else data.columns[..., k])
            for k, (name, speed) in enumerate(zip(data.column_names, speeds, strict=True))
        ]
        changes["columns"] = np.stack(columns, axis=-1)
    inner = _inner(data)
    balance = "power" if power else "momentum"
    taken = data.take(inner, f"Took the balance of {balance} over two steps at every instant.")
    return taken.replace(**changes)


def rows_of(recording: Recording, lib: Library, power: bool) -> Iterator[FloatArray]:
    """Yield D P − S R, or D E for power, at the inner instants, some columns at a time.

    The regressor is evaluated anew for each group of columns, because the whole would exceed the
    memory.
    """
    joints = 1 if power else lib.n_joints
    width = max(1, HELD // (len(recording) * joints))
    count = len(lib.base_columns)
    for first in range(0, count, width):
        group = slice(first, min(first + width, count))
        parts = [
            _chunk(recording, slice(start, min(start + CHUNK + 2, part.stop)), group, lib, power)
            for part in segments(recording.t)
            for start in range(part.start, part.stop - 2, CHUNK)
        ]
        yield np.concatenate(parts)


def torque_of_rows(recording: Recording, lib: Library, beta: FloatArray) -> FloatArray:
    """(D P − S R) β at the inner instants, (N, n)."""
    step, torques = 1.0 / recording.rate_hz, []
    for part in segments(recording.t):
        for start in range(part.start, part.stop - 2, CHUNK):
            taken = slice(start, min(start + CHUNK + 2, part.stop))
            q, dq = recording.q[taken], recording.required("dq")[taken]
            # One product of a tall matrix, instead of one per instant.
            momentum, force = (
                (rows.reshape(-1, len(beta)) @ beta).reshape(q.shape)
                for rows in lib.momentum_regressor(q, dq)
            )
            torques.append(_difference(momentum, step) - _simpson(force))
    return np.concatenate(torques)


def _chunk(
    recording: Recording, part: slice, group: slice, lib: Library, power: bool
) -> FloatArray:
    """Rows of the inner instants of a part without holes."""
    q, dq = recording.q[part], recording.required("dq")[part]
    step = 1.0 / recording.rate_hz
    if power:
        return _difference(lib.energy_regressor(q, dq)[:, None, group], step)
    momentum, force = (a[:, :, group] for a in lib.momentum_regressor(q, dq))
    return np.asarray(_difference(momentum, step) - _simpson(force))


def _speed(recording: Recording, name: str) -> FloatArray:
    """Velocities that belong to a column: of the joints, or of the motors that drive several."""
    dq = recording.required("dq")
    if name in COLUMNS and COLUMNS[name].of_motors and recording.motors is not None:
        return np.asarray(dq @ recording.motors.T)
    return dq


def _inner(recording: Recording) -> FloatArray:
    """Indices of all instants except the first and last of every segment."""
    return np.concatenate([np.arange(s.start + 1, s.stop - 1) for s in segments(recording.t)])


def _summed(recording: Recording, values: FloatArray) -> FloatArray:
    return np.concatenate([_simpson(values[part]) for part in segments(recording.t)])


def _differenced(recording: Recording, values: FloatArray) -> FloatArray:
    step = 1.0 / recording.rate_hz
    return np.concatenate([_difference(values[part], step) for part in segments(recording.t)])


def _simpson(values: FloatArray) -> FloatArray:
    return (values[:-2] + 4.0 * values[1:-1] + values[2:]) / 6.0


def _difference(values: FloatArray, step: float) -> FloatArray:
    return (values[2:] - values[:-2]) / (2.0 * step)
