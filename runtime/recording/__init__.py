"""Log files to recordings and back; units, signs and joint order of a log are handled here only."""

from runtime.recording.consistency import check_consistency
from runtime.recording.reader import plan_of, read_recording, write_recording
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recipes.recipe_file import bundled_names, load_recipe, recipe_text
from runtime.recording.recording import Recording
from runtime.recording.settings import EVERYTHING, REGRESSORS, Friction, Preparation, Split
from runtime.recording.streamed import StreamedRecording, is_large, open_log, open_streamed

__all__ = [
    "EVERYTHING",
    "REGRESSORS",
    "Friction",
    "Preparation",
    "Recipe",
    "Recording",
    "Split",
    "StreamedRecording",
    "bundled_names",
    "check_consistency",
    "is_large",
    "load_recipe",
    "open_log",
    "open_streamed",
    "plan_of",
    "read_recording",
    "recipe_text",
    "write_recording",
]
