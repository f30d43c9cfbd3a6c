"""The log doctor: what is wrong with a log, and the recipe that would read it right.

Nothing is ever changed: every finding says what was seen and what to write. The traps, by number:

    1 tool or hand that the model lacks or has too much      8 rounding of the model file (symgen)
    2 clock: repeats, ticks, jitter, holes, units, delay     9 corrupt rows, order of columns
    3 sign of the torque                                    10 wrap at ±π, degrees
    4 a torque that is a model's output                     11 unit of the effort
    5 direction of gravity                                  12 one run
    6 gears that couple joints                              13 joints that carry little torque
    7 friction at rest

Rounding, and what a model file carries, is told by `python -m symgen inspect`.
"""

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
