"""Recipes: every key is known, every value possible, or the message names the one that is not."""

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import Preparation, Split, read_recording
from runtime.recording.recipes.recipe_file import bundled_names, load_recipe, recipe_from_table

TIME = {"rate_hz": 100.0}
POSITION = {"file": "q.csv", "columns": ["a", "b"], "unit": "rad"}


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_recipes_load_and_are_whole(name):
    """Oracle: each bundled recipe says what a reader and a person need."""
    recipe = load_recipe(name)
    assert recipe.name == name
    assert recipe.robot
    assert recipe.description
    assert recipe.position is not None
    assert recipe.torque is not None
    assert recipe.split is not None
    assert recipe.friction is not None
    assert len(recipe.source.commit) == 40
    assert all(len(digest) == 64 for digest in recipe.source.sha256.values())
    assert load_recipe(recipe) is recipe


def test_bundled_names():
    """Oracle: the data sets that the documentation names."""
    assert bundled_names() == ("lwr4_flobaroid", "panda_gaz", "tx40_figaroh")


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ({"positon": POSITION}, "unknown key 'positon'; did you mean 'position'"),
        ({"xyzzy": 1}, "unknown key 'xyzzy'; valid keys are name"),
        ({"preparation": {"cutof_hz": 1.0}}, r"\[preparation\].*'cutof_hz'.*'cutoff_hz'"),
        ({"position": {**POSITION, "units": "deg"}}, r"\[position\].*'units'.*'unit'"),
        ({"position": {"file": "q.csv"}, "time": TIME}, r"\[position\] expects the key unit"),
        ({"position": {**POSITION, "unit": "degrees"}, "time": TIME}, "rad, deg, m, mm; got 'deg"),
        ({"position": POSITION}, r"a table \[time\]"),
        ({"torque": POSITION, "time": TIME}, r"\[torque\] unit expects one of N\*m"),
        ({"torque": {**POSITION, "unit": "N*m"}}, r"\[torque\] expects \[position\] too"),
        ({"time": {"column": "t", "unit": "min"}}, "s, ms, us, ns; got 'min'"),
        ({"time": {"rate_hz": 10.0, "unit": "s"}}, "but got both"),
        ({"time": {"rate_hz": 0}}, "rate_hz expects a number above 0"),
        (
            {"time": {"rate_hz": "fast"}},
            r"\[time\]: rate_hz expects a number or nothing, got 'fast'",
        ),
        ({"time": {"rate_hz": True}}, r"\[time\]: rate_hz expects a number or nothing, got True"),
        ({"time": 100}, r"\[time\]: it expects a table, got 100"),
        ({"position": {**POSITION, "order": [0, 0]}}, "permutation of 0 … 1, got .0, 0."),
        ({"position": {**POSITION, "order": [1, 2]}}, "permutation"),
        ({"position": {**POSITION, "sign": [1, 2]}}, "sign expects 1 or -1"),
        ({"position": {**POSITION, "layout": "xls"}}, "layout expects one of csv, flat, npz"),
        ({"position": {**POSITION, "layout": "flat"}}, "width ≥ 1, got 0"),
        ({"gear": {"matrix": [[1.0, 2.0], [2.0, 4.0]]}}, "singular"),
        ({"gear": {"matrix": [[1.0, 2.0]]}}, "n rows of n numbers"),
        ({"gear": {"matrix": [[1.0], [2.0, 4.0]]}}, "n rows of n numbers"),
        ({"gear": {"matrix": [[float("nan")]]}}, "singular"),
        ({"gear": {"ratio": 3}}, r"\[gear\] has the unknown key 'ratio'"),
        ({"gear": 3}, r"\[gear\] expects a table"),
        ({"split": {"train": [0.0, 0.5], "validation": [0.4, 0.6]}}, "not overlapping"),
        ({"split": {"train": [0.2, 0.2]}}, "not empty"),
        ({"split": {"test": [0.6, 1.2]}}, r"within \[0, 1\]"),
        ({"split": {"train": [0.2]}}, r"\[split\]: train expects a list of length 2, got \[0.2\]"),
        ({"preparation": {"filter": "fir"}}, "butterworth, average, savitzky-golay, none"),
        ({"preparation": {"filter": "butterworth"}}, "expects cutoff_hz"),
        ({"preparation": {"filter": "average"}}, "expects window_s"),
        ({"preparation": {"rest_speed": -1.0}}, "rest_speed expects a number above 0"),
        ({"leave_out": [[2.0, 1.0]]}, "leave_out expects intervals .from, to. in s"),
        ({"leave_out": [1.0, 2.0]}, r"leave_out\[0\] expects a list, got 1.0"),
        ({"friction": {"coulomb_speed": 0.0}}, "coulomb_speed expects a number above 0"),
    ],
)
def test_impossible_recipes_name_the_key(table, match):
    """Property: an impossible recipe is one sentence that names the key and what is valid."""
    with pytest.raises(RecordingError, match=match) as caught:
        recipe_from_table(table)
    assert "\n" not in str(caught.value)


def test_recipe_files_that_are_none(tmp_path):
    """Property: what is no recipe file says so and lists the bundled names."""
    with pytest.raises(RecordingError, match=r"no recipe 'nowhere'; .*panda_gaz"):
        load_recipe("nowhere")
    (tmp_path / "x.toml").write_text("a = ")
    with pytest.raises(RecordingError, match=r"recipe x.toml cannot be read as TOML"):
        load_recipe(tmp_path / "x.toml")
    (tmp_path / "x.toml").write_text("[tiem]\nrate_hz = 1")
    with pytest.raises(RecordingError, match=r"recipe x.toml: .*'tiem'; did you mean 'time'"):
        load_recipe(tmp_path / "x.toml")


@pytest.mark.parametrize(
    ("position", "match"),
    [
        ({"order": [0, 1, 2]}, "order names 3 joints, but the file has 2"),
        ({"sign": [1.0, 1.0, 1.0]}, "sign expects one value or 2, got 3"),
        ({"offset": [1.0, 1.0, 1.0]}, "offset expects one value or 2, got 3"),
        ({"columns": ["a", "z"]}, "columns a, z, but z is missing"),
        ({"columns": [0, 7]}, "a column 7, but has 2 columns"),
        ({"columns": []}, "names no columns of q.csv"),
    ],
)
def test_recipes_that_do_not_fit_the_file(tmp_path, position, match):
    """Property: a recipe for another file is told apart by what it asks for."""
    (tmp_path / "q.csv").write_text("a,b\n" + "1,2\n3,4\n" * 5)
    recipe = recipe_from_table({"time": TIME, "position": {**POSITION, **position}})
    with pytest.raises(RecordingError, match=match):
        read_recording(tmp_path, recipe)


def test_gear_of_another_robot(tmp_path):
    """Property: a gear matrix must have one row per joint of the file."""
    (tmp_path / "q.csv").write_text("a,b\n" + "1,2\n3,4\n" * 5)
    table = {"time": TIME, "position": POSITION, "gear": {"matrix": [[2.0]]}}
    with pytest.raises(RecordingError, match="1 × 1, but position has 2 joints"):
        read_recording(tmp_path, recipe_from_table(table))


def test_defaults_do_nothing():
    """Oracle: without a recipe no step is taken and the split is that of the documentation."""
    assert Preparation().filter == "none"
    assert Preparation().rate_hz is None
    assert Split().test == (0.6, 1.0)


@pytest.mark.parametrize(("unit", "scale"), [("A", 1.0), ("mA", 1e-3)])
def test_current_needs_and_uses_gains(tmp_path, unit, scale):
    """Oracle: motor current times the stated gain is torque."""
    (tmp_path / "q.csv").write_text("a,b\n" + "1,2\n3,4\n" * 5)
    torque = {**POSITION, "unit": unit, "gain": [10.0 / scale, 0.5 / scale]}
    recipe = recipe_from_table({"time": TIME, "position": POSITION, "torque": torque})
    recording = read_recording(tmp_path, recipe)
    assert recording.tau is not None
    # One product by 1e-3 rounds.
    assert recording.tau[:2] == pytest.approx(np.array([[10.0, 1.0], [30.0, 2.0]]), rel=1e-15)
