"""`Recipe` → TOML that `recipe_file` reads back as the same recipe; defaults are omitted."""

import dataclasses
import json
from collections.abc import Iterator
from typing import Any

from runtime.recording.recipes.control_law import ControlLaw
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.settings import Friction


def recipe_text(recipe: Recipe, *comments: str) -> str:
    """The recipe as TOML, under comments of a line each."""
    lines = [f"# {' '.join(comment.split())}" for comment in comments]
    gear = {"gear": {"matrix": recipe.gear}} if recipe.gear else {}
    return "\n".join([*lines, *_table(_facts(recipe) | gear, ())]) + "\n"


def _facts(part: Any) -> dict[str, Any]:
    """Fields of a dataclass that differ from their defaults; parts without any are omitted."""
    facts = {}
    for item in dataclasses.fields(part):
        value = getattr(part, item.name)
        if item.name == "gear" and isinstance(part, Recipe | Friction):
            continue  # [gear] is a table of its own
        if value is None or value == item.default:
            continue
        if isinstance(value, ControlLaw):
            facts["torque"] = _facts(value)
        elif dataclasses.is_dataclass(value):
            facts[item.name] = _facts(value)
            if not facts[item.name] and item.default is not None:
                del facts[item.name]
        elif value != {}:
            facts[item.name] = value
    return facts


def _table(facts: dict[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Lines of a table: its values first, then the tables within."""
    for key, value in facts.items():
        if not isinstance(value, dict):
            yield f"{_key(key)} = {toml_value(value)}"
    for key, value in facts.items():
        if isinstance(value, dict):
            yield f"\n[{'.'.join(map(_key, (*path, key)))}]"
            yield from _table(value, (*path, key))


def _key(key: str) -> str:
    bare = key.replace("_", "").replace("-", "")
    return key if bare.isascii() and bare.isalnum() else toml_value(key)


def toml_value(value: Any) -> str:
    """A number, a text, a truth value or a tuple of them."""
    if isinstance(value, tuple):
        rows = value and isinstance(value[0], tuple)
        inner = (",\n    " if rows else ", ").join(map(toml_value, value))
        return f"[\n    {inner},\n]" if rows else f"[{inner}]"
    if isinstance(value, str):
        # TOML has no \/ and JSON no DEL; all other escapes are the same.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)
