"""Log files to recordings and back; units, signs and joint order of a log are handled here only."""

from runtime.recording.reader import read_recording, write_recording
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recording import Recording
from runtime.recording.settings import EVERYTHING, REGRESSORS, Friction, Preparation, Split

__all__ = [
    "EVERYTHING",
    "REGRESSORS",
    "Friction",
    "Preparation",
    "Recipe",
    "Recording",
    "Split",
    "read_recording",
    "write_recording",
]
