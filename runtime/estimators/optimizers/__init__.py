"""One loop and the optimisers that it runs; robots and files are of no concern here."""

from runtime.estimators.optimizers.adam import (
    Adam,
    AdamOptions,
    AdamState,
    adam_start,
    adam_step,
)
from runtime.estimators.optimizers.levenberg_marquardt import (
    LevenbergMarquardt,
    LevenbergOptions,
    LevenbergState,
)
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
