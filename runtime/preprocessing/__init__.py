"""Recording → Recording: clock, grid, filters, derivatives, split; each step joins the history."""

from runtime.preprocessing.clock import repair_clock
from runtime.preprocessing.filters import (
    differentiate,
    is_filtered,
    low_pass,
    moving_average,
    savitzky_golay,
)
from runtime.preprocessing.pipeline import DOCUMENT, momentum_torque, prepare, prepare_power
from runtime.preprocessing.segments import (
    advance_torque,
    decimate,
    drop_rest,
    resample,
    segments,
    split,
    trim,
)
from runtime.recording import Preparation, Split, check_consistency

__all__ = [
    "DOCUMENT",
    "Preparation",
    "Split",
    "advance_torque",
    "check_consistency",
    "decimate",
    "differentiate",
    "drop_rest",
    "is_filtered",
    "low_pass",
    "momentum_torque",
    "moving_average",
    "prepare",
    "prepare_power",
    "repair_clock",
    "resample",
    "savitzky_golay",
    "segments",
    "split",
    "trim",
]
