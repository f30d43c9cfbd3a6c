"""runtime.recording.recipes.recipe_file: recipes as TOML."""

import tomllib

import pytest

from runtime.recording import Friction, Recipe
from runtime.recording.recipes.recipe import Signal, Time
from runtime.recording.recipes.recipe_file import (
    bundled_names,
    load_recipe,
    recipe_from_table,
    recipe_text,
)

ODD = Recipe(
    run="odd",
    name='quo"te\\\n\x7fπ',
    joints=("a", "b"),
    time=Time(column=3, unit="ms", layout="csv", from_zero=True),
    position=Signal(("deg", "rad"), columns=("x y", 2), order=(1, 0), sign=(1.0, -1.0)),
    torque=Signal("A", columns=(1, 2), gain=(0.1 + 0.2, 1e-300)),
    gear=((1.0, 0.0), (0.5, 1e11)),
    friction=Friction(()),
)


@pytest.mark.parametrize(
    "recipe", [*bundled_names(), ODD], ids=lambda each: getattr(each, "run", each)
)
def test_a_recipe_as_text_reads_back_as_itself(recipe):
    """Property: TOML by Python's own reader, and the recipe's; a comment stays one line."""
    whole = load_recipe(recipe)
    text = recipe_text(whole, "two\nlines")
    assert text.startswith("# two lines\n")
    assert recipe_from_table(tomllib.loads(text)) == whole
