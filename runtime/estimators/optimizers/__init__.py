"""One loop, small pure steps: nothing here knows robots or files."""

from runtime.estimators.optimizers.adam import AdamOptions, AdamState, adam_start, adam_step
from runtime.estimators.optimizers.levenberg_marquardt import (
    LevenbergOptions,
    LevenbergState,
    levenberg,
    levenberg_start,
    levenberg_step,
)
from runtime.estimators.optimizers.loop import Outcome, Status, StoppingRule, Trace, minimise

__all__ = [
    "AdamOptions",
    "AdamState",
    "LevenbergOptions",
    "LevenbergState",
    "Outcome",
    "Status",
    "StoppingRule",
    "Trace",
    "adam_start",
    "adam_step",
    "levenberg",
    "levenberg_start",
    "levenberg_step",
    "minimise",
]
