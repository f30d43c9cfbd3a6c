"""TOML ↔ `Recipe`; an unknown key, a wrong type or a repeated key is an error.

Recipes are written with one line per list, which tomli-w would break into one per number.
"""

import dataclasses
import difflib
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import toml_lines
from runtime.common.records import record_from_table, record_from_toml
from runtime.errors import RecordingError
from runtime.recording.formats import FORMATS
from runtime.recording.recipes.recipe import ControlLaw, Recipe, Signal, Source, Time
from runtime.recording.settings import Friction, Preparation, Split, one_of

FOLDER = Path(__file__).resolve().parent
_PARTS: dict[str, type] = {
    "source": Source,
    "time": Time,
    **dict.fromkeys(("position", "velocity", "acceleration", "torque"), Signal),
    "preparation": Preparation,
    "split": Split,
    "friction": Friction,
}
"""Table → its record; [gear], [extra.NAME] and [torque] with a law have forms of their own."""


def bundled_names() -> tuple[str, ...]:
    """Names of the recipes that come with the package."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_recipe(which: str | Path | Recipe) -> Recipe:
    """Recipe of a TOML file or by the name of a bundled one; a `Recipe` passes through."""
    if isinstance(which, Recipe):
        return which
    path = Path(which)
    if path.suffix != ".toml" and str(which) in bundled_names():
        path = FOLDER / f"{which}.toml"
    if not path.is_file():
        raise RecordingError(
            f"there is no recipe {str(which)!r}; give the path of a TOML file "
            f"or one of the bundled names {', '.join(bundled_names())}"
        )
    table = record_from_toml(dict[str, Any], path, f"recipe {path.name}", RecordingError)
    name = path.resolve().parent.name if path.name == "recipe.toml" else path.stem
    try:
        return recipe_from_table({"name": name, **table})
    except RecordingError as error:
        raise RecordingError(f"recipe {path.name}: {error}") from error


def recipe_from_table(table: dict[str, Any]) -> Recipe:
    """Recipe from the nested dictionary of a TOML file."""
    keys = tuple(item.name for item in dataclasses.fields(Recipe) if item.name != "law")
    _check_keys(table, keys, "")
    torque = table.get("torque")
    is_law = isinstance(torque, dict) and "law" in torque
    parts: dict[str, Any] = {
        key: _gear_matrix(value) if key == "gear" else _part(_PARTS[key], value, key)
        for key, value in table.items()
        if key in (*_PARTS, "gear") and not (is_law and key == "torque")
    }
    if isinstance(table.get("extra"), dict):
        extra = table["extra"].items()
        parts["extra"] = {key: _part(Signal, value, f"extra.{key}") for key, value in extra}
    if is_law:
        parts["law"] = _part(ControlLaw, torque, "torque")
    others = {key: value for key, value in table.items() if key not in (*_PARTS, "gear", *parts)}
    return record_from_table(Recipe, others | parts, "the recipe", RecordingError)


def _gear_matrix(table: Any) -> tuple[tuple[float, ...], ...]:
    """Gear matrix R (motor angle = R · joint angle): square, finite, invertible."""
    if not isinstance(table, dict):
        raise RecordingError(f"[gear] expects a table with the key matrix, got {table!r}")
    _check_keys(table, ("matrix",), "gear")
    try:
        matrix = np.array(table["matrix"], dtype=np.float64)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise RecordingError(
            "[gear] expects n rows of n numbers; write matrix = [[…], …]"
        ) from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise RecordingError(f"[gear] matrix expects n rows of n numbers, got {matrix.shape}")
    if not np.isfinite(matrix).all() or np.linalg.cond(matrix) > 1e12:
        raise RecordingError(
            "[gear] matrix is expected to be invertible, but it is singular; "
            "write the full matrix R of q_motor = R q_joint"
        )
    return tuple(tuple(map(float, row)) for row in matrix)


def _part(kind: type[Any], table: Any, where: str) -> Any:
    """Record of one table of the recipe; the checks of the record name the table, too."""
    if isinstance(table, dict):  # msgspec passes over other keys of a data class
        names = tuple(item.name for item in dataclasses.fields(kind) if item.name != "gear")
        _check_keys(table, (*names, "gear") if kind is ControlLaw else names, where)
    try:
        record = record_from_table(kind, table, f"[{where}]", RecordingError)
        if kind in {Signal, Time}:
            one_of("layout", record.layout, ("", *FORMATS))
        return record
    except RecordingError as error:
        text = str(error)
        raise RecordingError(text if f"[{where}" in text else f"[{where}] {text}") from error


def _check_keys(table: dict[str, Any], valid: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in valid:
            near = difflib.get_close_matches(key, valid, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"valid keys are {', '.join(valid)}"
            place = f"[{where}]" if where else "the recipe"
            raise RecordingError(f"{place} has the unknown key {key!r}; {hint}")


def recipe_text(recipe: Recipe, *comments: str) -> str:
    """The recipe as TOML, under comments of a line each."""
    lines = [f"# {' '.join(comment.split())}" for comment in comments]
    return "\n".join([*lines, *toml_lines(_facts(recipe))]) + "\n"


def _facts(part: Any) -> dict[str, Any]:
    """Fields of a dataclass that differ from their defaults; parts without any are omitted."""
    facts = {}
    for item in dataclasses.fields(part):
        value = getattr(part, item.name)
        if item.name == "gear" and isinstance(part, Friction):
            continue  # that of [gear]
        if value is None or (value == item.default and value != Friction().columns):
            continue  # friction columns are stated even where they are the usual ones
        if item.name == "gear" and isinstance(part, Recipe):
            facts["gear"] = {"matrix": value}
        elif isinstance(value, ControlLaw):
            facts["torque"] = _facts(value)
        elif dataclasses.is_dataclass(value):
            facts[item.name] = _facts(value)
            if not facts[item.name] and item.default is not None:
                del facts[item.name]
        elif item.name == "extra":
            facts |= {"extra": {key: _facts(each) for key, each in value.items()}} if value else {}
        elif value != {}:
            facts[item.name] = value
    return facts
