"""One loop and the optimisers that it runs; robots and files are of no concern here."""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
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
        StoppingRule,
        Trace,
        descend_traced,
        descend_validated,
        run,
        trace_of,
    )
    from runtime.estimators.optimizers.status import Status

__getattr__ = lazy_names(
    __name__,
    {
        "Adam": "runtime.estimators.optimizers.adam",
        "AdamOptions": "runtime.estimators.optimizers.adam",
        "AdamState": "runtime.estimators.optimizers.adam",
        "Iterate": "runtime.estimators.optimizers.loop",
        "LevenbergMarquardt": "runtime.estimators.optimizers.levenberg_marquardt",
        "LevenbergOptions": "runtime.estimators.optimizers.levenberg_marquardt",
        "LevenbergState": "runtime.estimators.optimizers.levenberg_marquardt",
        "Optimiser": "runtime.estimators.optimizers.loop",
        "Outcome": "runtime.estimators.optimizers.loop",
        "Status": "runtime.estimators.optimizers.status",
        "StoppingRule": "runtime.estimators.optimizers.loop",
        "Trace": "runtime.estimators.optimizers.loop",
        "adam_start": "runtime.estimators.optimizers.adam",
        "adam_step": "runtime.estimators.optimizers.adam",
        "descend_traced": "runtime.estimators.optimizers.loop",
        "descend_validated": "runtime.estimators.optimizers.loop",
        "run": "runtime.estimators.optimizers.loop",
        "trace_of": "runtime.estimators.optimizers.loop",
    },
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
