"""Further signals of a log: table [extra] of a recipe, steps of the preparation, logs in blocks."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import Preparation, Recording, read_recording
from runtime.recording.preprocessing.segments import on_grid
from runtime.recording.recipes.recipe_file import load_recipe, recipe_text
from runtime.recording.streamed import open_streamed

N, JOINTS = 200, 3
KELVIN = 273.15


def arrays() -> dict[str, np.ndarray]:
    """A log whose motors warm up, from an hour after some other start of the clock on."""
    t = 3600.0 + np.arange(N) / 100
    wave = np.sin(np.outer(t, [1.0, 2.0, 3.0]))
    warm = 300.0 + np.outer(t - t[0], [1.0, 2.0, 3.0])
    return {"t": t, "q": wave, "dq": wave, "tau": wave, "warm": warm, "one": warm[:, :1]}


def log_and_recipe(folder: Path, key: str = "warm") -> tuple[Path, Path]:
    """Paths of a log and of a recipe with a temperature in kelvins."""
    np.savez(folder / "log.npz", **arrays())  # type: ignore[arg-type]
    text = f'[extra.temperature]\nkey = "{key}"\nunit = "degC"\noffset = -{KELVIN}\n'
    (folder / "recipe.toml").write_text(text)
    return folder / "log.npz", folder / "recipe.toml"


@pytest.mark.parametrize("streamed", [False, True])
@pytest.mark.parametrize("key", ["warm", "one"])
def test_a_recipe_names_a_signal_of_the_joints_or_of_the_robot(tmp_path, key, streamed):
    """Oracle: the array in °C, one column for all joints repeated; whole and in blocks alike."""
    log, recipe = log_and_recipe(tmp_path, key)
    if streamed:
        recording = open_streamed(log, recipe).block(50, N)
        rows = slice(50, N)
    else:
        recording, rows = read_recording(log, recipe), slice(0, N)
    expected = np.broadcast_to(arrays()[key] - KELVIN, (N, JOINTS))[rows]
    np.testing.assert_allclose(recording.signal("temperature"), expected, rtol=1e-14)
    # The clock of the log, whatever rows are held.
    uptime = recording.signal("uptime")
    assert uptime is not None
    np.testing.assert_allclose(uptime[:, 0], np.arange(N)[rows] / 100, atol=1e-9)
    assert recording.signal("humidity") is None


def test_steps_keep_further_signals_beside_the_motion(tmp_path):
    """Property: rows that are taken, and instants of a grid, have their signals and their clock."""
    whole = read_recording(*log_and_recipe(tmp_path))
    part = whole.take(slice(20, 120), "Took a part.")
    np.testing.assert_array_equal(part.signals["temperature"], whole.signals["temperature"][20:120])
    assert part.signal("uptime")[0, 0] == pytest.approx(0.2)
    fine = on_grid(part, Preparation(max_gap_s=0.5, grid_hz=200.0))
    expected = np.interp(fine.t, whole.t, whole.signals["temperature"][:, 2])
    np.testing.assert_allclose(fine.signals["temperature"][:, 2], expected, rtol=1e-12)
    titles, values = part.titled()
    assert titles[-JOINTS:] == ["temperature1", "temperature2", "temperature3"]
    np.testing.assert_array_equal(values[:, -JOINTS:], part.signals["temperature"])


def test_recipe_text_keeps_them(tmp_path):
    """Property: the text of a recipe with further signals is read as the same recipe."""
    recipe = load_recipe(log_and_recipe(tmp_path)[1])
    (tmp_path / "again.toml").write_text(recipe_text(recipe))
    again = load_recipe(tmp_path / "again.toml")
    assert again.extra == recipe.extra
    assert again.extra["temperature"].offset == -KELVIN


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('[extra.temperature]\nkey = "warm"\nunit = "K"\n', r"\[extra.temperature\] unit expects"),
        ('[extra.temperature]\nkey = "two"\nunit = "degC"\n', "one column or 3, got 2"),
        ('[extra.temperature]\nkeys = "two"\nunit = "degC"\n', "unknown key 'keys'"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, sentence):
    """Property: one sentence with what was expected and what came."""
    np.savez(tmp_path / "log.npz", **arrays(), two=np.zeros((N, 2)))
    (tmp_path / "recipe.toml").write_text(text)
    with pytest.raises(RecordingError, match=sentence):
        read_recording(tmp_path / "log.npz", tmp_path / "recipe.toml")


def test_a_signal_of_another_shape_is_refused():
    """Property: one value per joint and instant."""
    with pytest.raises(RecordingError, match=r"expected temperature of the shape \(4, 2\)"):
        Recording(np.arange(4.0), np.zeros((4, 2)), signals={"temperature": np.zeros((4, 1))})
