"""Comparison of methods on the same problem: one row each, advice, and files."""

from runtime.identification.comparison.advice import Advice, advise
from runtime.identification.comparison.output import write_comparison
from runtime.identification.comparison.row import FAILED, NOT_RUN, RAN, Figures, Row
from runtime.identification.comparison.run import Comparison, Truth, compare, read_truth

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
