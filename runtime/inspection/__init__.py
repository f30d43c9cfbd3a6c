"""Inspection of logs: checks with findings, and a recipe that reads the log correctly.

No file is changed: every finding states what was measured and what to write. The traps, by number:

    1 tool or hand that the model lacks or has too much      8 rounding of the model file (symgen)
    2 clock: repeats, ticks, jitter, holes, units, delay     9 corrupt rows, order of columns
    3 sign of the torque                                    10 wrap at ±π, degrees
    4 a torque that is a model's output                     11 unit of the effort
    5 direction of gravity                                  12 one run
    6 gears that couple joints                              13 joints that carry little torque
    7 friction at rest

Rounding and other faults of a model file are reported by `python -m symgen inspect`.
"""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.inspection.finding import ERROR, INFO, WARNING, Finding
    from runtime.inspection.inspection import Inspection, inspect_log
    from runtime.inspection.proposed_recipe import recipe_text

__all__ = [
    "ERROR",
    "INFO",
    "WARNING",
    "Finding",
    "Inspection",
    "inspect_log",
    "recipe_text",
]

__getattr__ = lazy_names(
    __name__,
    {
        "ERROR": "runtime.inspection.finding",
        "Finding": "runtime.inspection.finding",
        "INFO": "runtime.inspection.finding",
        "Inspection": "runtime.inspection.inspection",
        "WARNING": "runtime.inspection.finding",
        "inspect_log": "runtime.inspection.inspection",
        "recipe_text": "runtime.inspection.proposed_recipe",
    },
)
