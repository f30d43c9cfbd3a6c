"""predictions.npz: torques over the test part, marks of the rows that were fitted, and recipe."""

import tomllib
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from runtime.common.files import replacing, require_file
from runtime.errors import RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.identification.identified import Identification
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recipes.recipe_file import recipe_from_table, recipe_text
from runtime.recording.row_marks import Marks


def write_predictions(result: Identification, file: Path) -> None:
    """Write the torques of both models over the test part, row marks and recipe."""
    test = samples_of(result.test, result.lib)
    arrays: dict[str, Any] = {
        "t": np.asarray(result.test.t),
        "dq": test.dq,
        "measured": test.tau,
        "before": result.before(result.test),
        "after": result.predict_test(),
    }
    if test.base is None:  # scores of a later log are compared with those of these rows
        arrays |= {"q": test.q, "ddq": test.ddq, "columns": test.columns}
    if (recipe := of_further_logs(result)) is not None:
        arrays["recipe"] = recipe_text(recipe)
    if result.row_marks is not None:
        arrays["row_marks"] = result.row_marks
    with replacing(file) as content:
        np.savez(content, **arrays)  # noise does not compress


def of_further_logs(result: Identification) -> Recipe | None:
    """Recipe of the log without what holds for its own rows."""
    recipe = result.train.recipe
    return None if recipe is None else recipe.replace(leave_out=(), split=None)


def fitted_rows(file: Path) -> tuple[Marks | None, Recipe | None]:
    """Marks of the rows that were fitted, and recipe of their log, from predictions.npz."""
    try:
        with np.load(require_file(file), allow_pickle=False) as arrays:
            marks, text = (arrays.get(name, np.zeros(0)) for name in ("row_marks", "recipe"))
            table = tomllib.loads(str(text)) if text.dtype.kind == "U" else None
            recipe = None if table is None else recipe_from_table(table)
    except (OSError, ValueError, LookupError, BadZipFile, RecordingError):
        return None, None
    return marks if marks.dtype == np.uint64 and marks.ndim == 1 else None, recipe
