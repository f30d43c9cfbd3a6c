"""The usual order of the steps, driven by a `Preparation`; each step is skipped unless set."""

from collections.abc import Callable

from runtime.friction import LINEAR, add_columns, completed, renewed_rotor
from runtime.library import Library
from runtime.preprocessing.clock import repair_clock
from runtime.preprocessing.filters import (
    ALL,
    differentiate,
    low_pass,
    moving_average,
    savitzky_golay,
)
from runtime.preprocessing.segments import advance_torque, decimate, drop_rest, resample, trim
from runtime.preprocessing.thinning import thinned
from runtime.recording import Friction, Preparation, Recording

DOCUMENT = Preparation(filter="average", window_s=0.051, rate_hz=100.0)
"""Of the source document's Sec. 5.2: means over 51 ms of q, dq and τ; ddq from differences of dq,
averaged once more; 100 Hz."""


def prepare(
    recording: Recording,
    preparation: Preparation | None = None,
    *friction: Friction,
    lib: Library | None = None,
) -> Recording:
    """Clock → grid → delay → friction columns at the full rate → filter → derivative → trim → rate.

    Rest is dropped last. Without a preparation that of the recipe is used; without a recipe only
    missing derivatives are filled in, so a complete recording passes unchanged. Where dq was not
    measured, the friction columns come from the derivative of the filtered q, because tanh of a
    differentiated encoder signal is noise.

    Args:
        recording: as read.
        preparation: what to do.
        friction: friction columns to add, those of several side by side.
        lib: of the robot, for the columns that need it.

    Raises:
        RecordingError: a step cannot be taken; the message says which setting to change.
    """
    if preparation is None:
        preparation = recording.recipe.preparation if recording.recipe else Preparation()
    data = _settled(recording, preparation)
    wanted = any(terms.columns for terms in friction)
    if wanted and data.dq is not None:
        data = add_columns(data, *friction, lib=lib, later=LINEAR)
        data = completed(_reduced(data, preparation), *friction)
    else:
        missing = wanted and data.columns is None
        late = (lambda each: add_columns(each, *friction, lib=lib)) if missing else None
        data = renewed_rotor(_reduced(data, preparation, late))
    if preparation.rest_speed is not None:
        data = drop_rest(data, preparation.rest_speed)
    return data


def _settled(recording: Recording, preparation: Preparation) -> Recording:
    """Clock, grid, delay, and what was measured but is not wanted."""
    data = recording
    if preparation.clock_tick is not None:
        data = repair_clock(data, preparation.clock_tick)
    if preparation.max_gap_s is not None:
        data = resample(data, _grid_hz(data, preparation), preparation.max_gap_s)
    if preparation.torque_delay_s is not None:
        data = advance_torque(data, preparation.torque_delay_s)
    if preparation.derivative == "position" and (data.dq is not None or data.ddq is not None):
        data = data.replace(dq=None, ddq=None).noted("Set measured dq and ddq aside.")
    return data


def _reduced(
    recording: Recording,
    preparation: Preparation,
    late: Callable[[Recording], Recording] | None = None,
) -> Recording:
    """Filter, derivatives, columns that need these, trim, rate."""
    if preparation.filter == "butterworth" and preparation.rate_hz is not None and late is None:
        rows = thinned(recording, preparation)
        if rows is not None:
            return rows
    data = _derived(_filtered(recording, preparation), preparation)
    if late is not None:
        data = _filtered(late(data), preparation, ("columns",))
    if preparation.trim_s is not None:
        data = trim(data, preparation.trim_s)
    return data if preparation.rate_hz is None else decimate(data, preparation.rate_hz)


def _grid_hz(recording: Recording, preparation: Preparation) -> float:
    """The rate of the uniform grid: as stated, else one per tick, else the median rate."""
    if preparation.grid_hz is not None:
        return preparation.grid_hz
    if preparation.clock_tick is not None:
        return 1.0 / preparation.clock_tick
    return recording.rate_hz


def _filtered(
    recording: Recording, preparation: Preparation, only: tuple[str, ...] = ALL
) -> Recording:
    """The filter of the preparation; which settings it has, `Preparation` has checked."""
    window, cutoff = preparation.window_s or 0.0, preparation.cutoff_hz or 0.0
    if preparation.filter == "butterworth":
        return low_pass(recording, cutoff, preparation.order, only)
    if preparation.filter == "average":
        return moving_average(recording, window, only)
    if preparation.filter == "savitzky-golay":
        return savitzky_golay(recording, window, preparation.order, only)
    return recording


def _derived(recording: Recording, preparation: Preparation) -> Recording:
    """Missing derivatives; after a moving average the differentiated ddq is averaged as well."""
    missing = recording.ddq is None
    result = differentiate(recording)
    if missing and preparation.filter == "average" and preparation.window_s is not None:
        return moving_average(result, preparation.window_s, ("ddq",))
    return result
