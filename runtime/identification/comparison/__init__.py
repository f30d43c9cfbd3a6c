"""Comparison of methods on the same problem: one row each, advice, and files."""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.identification.comparison.advice import Advice, advise
    from runtime.identification.comparison.output import write_comparison
    from runtime.identification.comparison.row import FAILED, NOT_RUN, RAN, Figures, Row
    from runtime.identification.comparison.run import Comparison, compare
    from runtime.identification.comparison.truth import Truth, read_truth

__all__ = [
    "FAILED",
    "NOT_RUN",
    "RAN",
    "Advice",
    "Comparison",
    "Figures",
    "Row",
    "Truth",
    "advise",
    "compare",
    "read_truth",
    "write_comparison",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Advice": "runtime.identification.comparison.advice",
        "Comparison": "runtime.identification.comparison.run",
        "FAILED": "runtime.identification.comparison.row",
        "Figures": "runtime.identification.comparison.row",
        "NOT_RUN": "runtime.identification.comparison.row",
        "RAN": "runtime.identification.comparison.row",
        "Row": "runtime.identification.comparison.row",
        "Truth": "runtime.identification.comparison.truth",
        "advise": "runtime.identification.comparison.advice",
        "compare": "runtime.identification.comparison.run",
        "read_truth": "runtime.identification.comparison.truth",
        "write_comparison": "runtime.identification.comparison.output",
    },
)
