"""Mean of a column of a log that no signal of the robot uses, such as a temperature."""

from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.recording.log_files import LogFiles
from runtime.recording.reader import place_and_recipe
from runtime.recording.recipes.recipe import Recipe, Signal


def mean_of_column(log: str | Path, recipe: str | Path | Recipe | None, name: str) -> float:
    """Mean of the finite numbers of one column of a log, in the unit of the file."""
    place, chosen = place_and_recipe(log, recipe, None)
    files = LogFiles(place, chosen or Recipe())
    file = "" if chosen is None or chosen.position is None else chosen.position.file
    values = files.table("temperature", Signal("", file=file, key=name, columns=(name,))).values
    finite = values[np.isfinite(values)]
    if not finite.size:
        raise RecordingError(
            f"expected numbers in the column '{name}' of '{log}', got none; name another column"
        )
    return float(finite.mean())
