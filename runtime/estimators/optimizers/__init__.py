"""One loop and the optimisers that it runs; robots and files are of no concern here."""

from runtime.estimators.optimizers.loop import (
    Iterate,
    Optimiser,
    Outcome,
    Status,
    StoppingRule,
    Trace,
    descend_traced,
    descend_validated,
    run,
    trace_of,
)
from runtime.estimators.optimizers.steps import (
    Adam,
    AdamOptions,
    AdamState,
    LevenbergMarquardt,
    LevenbergOptions,
    LevenbergState,
    adam_start,
    adam_step,
)

__all__ = [
    "Adam",
    "AdamOptions",
    "AdamState",
    "Iterate",
    "LevenbergMarquardt",
    "LevenbergOptions",
    "LevenbergState",
    "Optimiser",
    "Outcome",
    "Status",
    "StoppingRule",
    "Trace",
    "adam_start",
    "adam_step",
    "descend_traced",
    "descend_validated",
    "run",
    "trace_of",
]
