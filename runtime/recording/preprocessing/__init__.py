"""Recording → Recording: clock, grid, filters, derivatives, split; each step joins the history."""

from runtime.recording import Preparation, Split, check_consistency
from runtime.recording.preprocessing.clock_repair import repair_clock
from runtime.recording.preprocessing.filters import (
    is_filtered,
    low_pass,
    moving_average,
    savitzky_golay,
)
from runtime.recording.preprocessing.parts import before_test, prepared_parts, split
from runtime.recording.preprocessing.pipeline import (
    DOCUMENT,
    momentum_torque,
    on_grid,
    prepare,
    prepare_power,
)
from runtime.recording.preprocessing.segments import (
    advance_torque,
    decimate,
    differentiate,
    drop_rest,
    resample,
    segments,
    trim,
)

__all__ = [
    "DOCUMENT",
    "Preparation",
    "Split",
    "advance_torque",
    "before_test",
    "check_consistency",
    "decimate",
    "differentiate",
    "drop_rest",
    "is_filtered",
    "low_pass",
    "momentum_torque",
    "moving_average",
    "on_grid",
    "prepare",
    "prepare_power",
    "prepared_parts",
    "repair_clock",
    "resample",
    "savitzky_golay",
    "segments",
    "split",
    "trim",
]
