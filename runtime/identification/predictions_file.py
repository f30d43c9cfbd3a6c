"""predictions.npz: torques over the test part, marks of the rows that were fitted, and recipe."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from runtime.common.files import replacing, require_file
from runtime.errors import RecordingError
from runtime.estimators.regression.samples import samples_of
from runtime.identification.identified import Identification
from runtime.library import Array
from runtime.recording.formats.npz import open_npz
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recipes.recipe_file import recipe_from_table, recipe_text
from runtime.recording.row_marks import Marks

FILE = "predictions.npz"
LARGEST_ACCEPTED = 1e100
"""Largest number that is accepted, in SI units; matplotlib cannot draw much larger ones."""


def write_predictions(folder: Path, arrays: Mapping[str, Any]) -> None:
    """Write the arrays of `predictions_of`, or of a free base, into a folder."""
    with replacing(folder / FILE) as content:
        np.savez(content, **arrays)  # noise does not compress


def predictions_of(result: Identification) -> dict[str, Any]:
    """Torques of both models over the test part, row marks and recipe."""
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
    return arrays


def of_further_logs(result: Identification) -> Recipe | None:
    """Recipe of the log without what holds for its own rows."""
    recipe = result.train.recipe
    return None if recipe is None else recipe.replace(leave_out=(), split=None)


def read_predictions(result: Path, **shapes: tuple[int, ...]) -> dict[str, Array]:
    """Instants t (N,) and named arrays (N, …) of finite numbers from the file of a result."""
    path = _path(result)
    expected = ", ".join(f"{name} {_text(shape)}" for name, shape in shapes.items())
    fault = (
        "identify again, or give the output folder of an identification; expected t (N,), "
        f"{expected}"
    )
    try:
        file = open_npz(require_file(path).read_bytes(), path.name)
        arrays = {name: np.asarray(file[name], dtype=float) for name in ("t", *shapes)}
    except OSError as error:
        reason = error.strerror or error
        raise RecordingError(f"cannot read '{path}' ({reason}); {fault}") from None
    except (RecordingError, ValueError, KeyError, TypeError):
        raise RecordingError(f"'{path}' is damaged; {fault}") from None
    t = arrays["t"]
    if t.ndim != 1 or len(t) < 2 or any(arrays[n].shape != (len(t), *shapes[n]) for n in shapes):
        came = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise RecordingError(f"'{path}' holds {came}; {fault}")
    if not all(np.abs(x).max(initial=0.0) <= LARGEST_ACCEPTED for x in arrays.values()):  # nor NaN
        raise RecordingError(f"'{path}' holds NaN or numbers above {LARGEST_ACCEPTED:g}; {fault}")
    return arrays


def fitted_rows(result: Path) -> tuple[Marks | None, Recipe | None]:
    """Marks of the rows that were fitted, and recipe of their log, where the file holds them."""
    try:
        with np.load(require_file(_path(result)), allow_pickle=False) as arrays:
            marks, text = (arrays.get(name, np.zeros(0)) for name in ("row_marks", "recipe"))
            table = tomllib.loads(str(text)) if text.dtype.kind == "U" else None
            recipe = None if table is None else recipe_from_table(table)
    except (OSError, ValueError, LookupError, BadZipFile, RecordingError):
        return None, None
    return marks if marks.dtype == np.uint64 and marks.ndim == 1 else None, recipe


def _path(result: Path) -> Path:
    """Of the folder of a result, or beside its result.json."""
    return (result if result.is_dir() else result.parent) / FILE


def _text(shape: tuple[int, ...]) -> str:
    return f"({', '.join(map(str, ('N', *shape)))})"
