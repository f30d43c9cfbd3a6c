"""One loop, small pure steps: nothing here knows robots or files."""

from runtime.optimizers.adam import AdamOptions, AdamState, adam_start, adam_step
from runtime.optimizers.loop import Outcome, Status, StoppingRule, Trace, minimise

__all__ = [
    "AdamOptions",
    "AdamState",
    "Outcome",
    "Status",
    "StoppingRule",
    "Trace",
    "adam_start",
    "adam_step",
    "minimise",
]
