"""The usual order of the steps, driven by a `Preparation`; each step is skipped unless set.

Rows of the equations of motion that need no accelerations.

    S τ = D P β − S R β + S F φ          p = P β = M dq,  R β = ∂(T − U)/∂q       ("momentum")
    S dq·τ = D E β + S dq·F φ            T + U = E β + const                      ("energy")

D x = (x₊ − x₋)/2h and S x = (x₋ + 4 x + x₊)/6 at every instant but the first and last of a segment:
Simpson's rule over two steps, exact to h⁴. Both sides then pass the filter of the preparation,
which is linear and the same at all times, so that its cut-off may lie in the middle of the motion:
β stays the same. A rotor's column is D dq, or D dq²/2. Source: Gautier & Khalil 1988, Slotine & Li
1987 (filtered dynamics).
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from runtime.errors import RecordingError
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.model import add_columns, completed, renewed_rotor
from runtime.recording.preprocessing import segments as clock
from runtime.recording.preprocessing.filters import low_pass, moving_average, savitzky_golay
from runtime.recording.recording import ALL
from runtime.recording.settings import COLUMNS

DOCUMENT = Preparation(filter="average", window_s=0.051, rate_hz=100.0)
"""Preparation of the source document, Sec. 5.2: means over 51 ms of q, dq and τ; ddq from
differences of dq, averaged once more; 100 Hz."""
MOTION, BELOW_RATE = 4.0, 0.4  # of the cut-off; low-pass of q without dq, if the rate allows


def prepare(
    recording: Recording,
    preparation: Preparation | None = None,
    *friction: Friction,
    lib: Library | None = None,
    rows: Array | None = None,
) -> Recording:
    """Prepare a recording: clock → grid → delay → friction columns → filter → derivative → trim →
    rate.

    Rest is dropped last. Without a preparation that of the recipe is used; without a recipe only
    missing derivatives are computed, so that a complete recording passes unchanged. Where dq was
    not measured, the friction columns come from the derivative of the filtered q, because tanh of a
    differentiated encoder signal is noise. Without accelerations (`preparation.regressor`) the rows
    are those of `momentum`, for energy as well: `prepare_power` returns those of power.

    Args:
        recording: as read.
        preparation: steps and their settings.
        *friction: friction columns to add, those of several terms side by side.
        lib: library of the robot, for the columns that need it and for rows without accelerations.
        rows: of the same recording and preparation, where only the friction differs.

    Returns:
        The prepared recording.

    Raises:
        RecordingError: a step cannot be taken; the message says which setting to change.
    """
    preparation = preparation or recording.preparation
    data = clock.on_grid(recording, preparation)
    if preparation.regressor != "acceleration" and data.rows is None:
        return _without_accelerations(data, preparation, friction, lib, False, rows)
    wanted = any(terms.columns for terms in friction)
    if preparation.derivative == "position" and (data.dq is not None or data.ddq is not None):
        data = data.replace(dq=None, ddq=None).noted("Set measured dq and ddq aside.")
    if wanted and data.dq is not None:
        data = add_columns(data, *friction, lib=lib, linear_later=True)
        data = completed(_reduced(data, preparation), *friction)
    else:
        missing = wanted and data.columns is None
        late = (lambda each: add_columns(each, *friction, lib=lib)) if missing else None
        data = renewed_rotor(_reduced(data, preparation, late))
    return _finished(data, preparation)


def prepare_power(
    recording: Recording, preparation: Preparation | None = None, *friction: Friction, lib: Library
) -> Recording:
    """Prepare rows of power: τ and the columns hold dq τ, the regressor is that of energy."""
    preparation = preparation or recording.preparation
    data = clock.on_grid(recording, preparation)
    return _without_accelerations(data, preparation, friction, lib, True, None)


def _without_accelerations(
    data: Recording,
    preparation: Preparation,
    friction: tuple[Friction, ...],
    lib: Library | None,
    power: bool,
    rows: Array | None,
) -> Recording:
    """After clock and grid: `momentum` at the full rate → filter → trim → rate → rest."""
    if lib is None:
        raise RecordingError(
            f"the {preparation.regressor} regressor expects the library of the robot, got none; "
            "give lib, or use the regressor of accelerations"
        )
    data = smooth_motion(data, lambda raw: _smooth_motion(raw, preparation))
    whole = balanced(data, friction, lib, power)
    reduced = _trimmed(_filtered(whole, preparation), preparation)
    if rows is not None:
        return _finished(reduced, preparation).replace(rows=rows)
    bare = whole.replace(dq=None, tau=None, columns=None, column_names=(), motors=None)
    groups: list[Any] = [
        _trimmed(_filtered(bare.replace(rows=part), preparation, ("rows",)), preparation).rows
        for part in rows_of(data, lib, power)
    ]
    return _finished(reduced.replace(rows=np.concatenate(groups, axis=2)), preparation)


def momentum_torque(
    recording: Recording, preparation: Preparation, lib: Library, beta: Array
) -> Recording:
    """Low-passed torque of a model without accelerations: F (D P − S R) β instead of τ."""
    uniform = clock.on_grid(recording, preparation)
    data = smooth_motion(uniform, lambda raw: _smooth_motion(raw, preparation))
    whole = balanced(data, (), lib, power=False)
    torque = torque_of_rows(data, lib, beta)
    return _trimmed(_filtered(whole.replace(tau=torque), preparation), preparation)


def _smooth_motion(recording: Recording, preparation: Preparation) -> Recording:
    """Low-pass the motion at `motion_hz`; else a q to be differentiated, above the cut-off."""
    limit = preparation.motion_hz
    if preparation.derivative == "position" and recording.dq is not None:
        recording = recording.replace(dq=None).noted("Set measured dq aside.")
    if limit is None and recording.dq is None and preparation.cutoff_hz is not None:
        wide = MOTION * preparation.cutoff_hz
        limit = wide if wide < BELOW_RATE * recording.rate_hz else None
    if limit is None:
        return recording
    return low_pass(recording, limit, preparation.order, ("q", "dq"))


def _reduced(
    recording: Recording,
    preparation: Preparation,
    late: Callable[[Recording], Recording] | None = None,
) -> Recording:
    """Filter, derivatives where rows need them, columns that need these, trim, rate."""
    data = _filtered(recording, preparation)
    if recording.rows is None:
        is_measured, window = data.ddq is not None, preparation.window_s
        data = clock.differentiate(data)
        if not is_measured and preparation.filter == "average" and window is not None:
            data = moving_average(data, window, ("ddq",))  # of differences
    if late is not None:
        data = _filtered(late(data), preparation, ("columns",))
    return _trimmed(data, preparation)


def _trimmed(recording: Recording, preparation: Preparation) -> Recording:
    """Apply trim and rate."""
    data = recording
    if preparation.trim_s is not None:
        data = clock.trim(data, preparation.trim_s)
    if preparation.rate_hz is not None:
        data = clock.decimate(data, preparation.rate_hz)
    return data


def _finished(recording: Recording, preparation: Preparation) -> Recording:
    """Drop rest and record the preparation."""
    data = recording.replace(prepared=preparation, signals={})  # the columns hold them
    return data if preparation.rest_speed is None else clock.drop_rest(data, preparation.rest_speed)


def _filtered(
    recording: Recording, preparation: Preparation, only: tuple[str, ...] = ALL
) -> Recording:
    """Apply the filter of the preparation, whose settings `Preparation` has checked."""
    window, cutoff = preparation.window_s or 0.0, preparation.cutoff_hz or 0.0
    if preparation.filter == "butterworth":
        return low_pass(recording, cutoff, preparation.order, only)
    if preparation.filter == "average":
        return moving_average(recording, window, only)
    if preparation.filter == "savitzky-golay":
        return savitzky_golay(recording, window, preparation.order, only)
    return recording


HELD = 16_000_000  # largest number of entries of the regressor that are held at a time (128 MB)
CHUNK = 256  # instants whose whole regressor is evaluated at a time and stays in the cache


def smooth_motion(recording: Recording, smooth: Callable[[Recording], Recording]) -> Recording:
    """The recording with q and dq only; a missing dq is that of a cubic spline, exact to h⁴."""
    data = clock.without_short(recording.replace(ddq=None), 4)
    clock.uniform_step(data, "go without accelerations")
    data = smooth(data)
    if data.dq is not None:
        return data
    slopes = [CubicSpline(data.t[s], data.q[s])(data.t[s], 1) for s in clock.segments(data.t)]
    return data.replace(dq=np.concatenate(slopes)).noted("Differentiated q to dq by cubic splines.")


def balanced(
    recording: Recording, friction: tuple[Friction, ...], lib: Library, power: bool
) -> Recording:
    """Averaged torque S τ, or S dq∘τ, with its friction columns; no row is computed yet."""
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
    # All instants except the first and last of every segment.
    inner = np.concatenate([np.arange(s.start + 1, s.stop - 1) for s in clock.segments(data.t)])
    balance = "power" if power else "momentum"
    taken = data.take(inner, f"Took the balance of {balance} over two steps at every instant.")
    return taken.replace(**changes)


def rows_of(recording: Recording, lib: Library, power: bool) -> Iterator[Array]:
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
            for part in clock.segments(recording.t)
            for start in range(part.start, part.stop - 2, CHUNK)
        ]
        yield np.concatenate(parts)


def torque_of_rows(recording: Recording, lib: Library, beta: Array) -> Array:
    """(D P − S R) β at the inner instants, (N, n)."""
    step, torques = 1.0 / recording.rate_hz, []
    for part in clock.segments(recording.t):
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


def _chunk(recording: Recording, part: slice, group: slice, lib: Library, power: bool) -> Array:
    """Rows of the inner instants of a part without holes."""
    q, dq = recording.q[part], recording.required("dq")[part]
    step = 1.0 / recording.rate_hz
    if power:
        return _difference(lib.energy_regressor(q, dq)[:, None, group], step)
    momentum, force = (a[:, :, group] for a in lib.momentum_regressor(q, dq))
    return np.asarray(_difference(momentum, step) - _simpson(force))


def _speed(recording: Recording, name: str) -> Array:
    """Velocities that belong to a column: of the joints, or of the motors that drive several."""
    dq = recording.required("dq")
    if name in COLUMNS and COLUMNS[name].of_motors and recording.motors is not None:
        return np.asarray(dq @ recording.motors.T)
    return dq


def _summed(recording: Recording, values: Array) -> Array:
    return np.concatenate([_simpson(values[part]) for part in clock.segments(recording.t)])


def _differenced(recording: Recording, values: Array) -> Array:
    step = 1.0 / recording.rate_hz
    return np.concatenate([_difference(values[part], step) for part in clock.segments(recording.t)])


def _simpson(values: Array) -> Array:
    return (values[:-2] + 4.0 * values[1:-1] + values[2:]) / 6.0


def _difference(values: Array, step: float) -> Array:
    return (values[2:] - values[:-2]) / (2.0 * step)
