"""Recording → Recording: clock, grid, filters, derivatives, split; each step joins the history."""

from runtime.recording.preprocessing.filters import is_filtered
from runtime.recording.preprocessing.pipeline import DOCUMENT, prepare

__all__ = ["DOCUMENT", "is_filtered", "prepare"]
