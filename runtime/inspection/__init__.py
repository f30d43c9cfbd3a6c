"""Inspection of logs: checks with findings, and a recipe that reads the log correctly.

No file is changed: every finding states what was measured and what to write. Rounding and other
faults of a model file are reported by `python -m symgen inspect`.
"""

from runtime.inspection.finding import ERROR, INFO, WARNING, Finding
from runtime.inspection.inspection import Inspection, inspect_log, recipe_text

__all__ = ["ERROR", "INFO", "WARNING", "Finding", "Inspection", "inspect_log", "recipe_text"]
