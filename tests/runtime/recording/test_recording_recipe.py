"""Recipes: units, order, sign, gear and files of a log are settled as written."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import Recipe, read_recording
from runtime.recording.recipes.recipe_file import recipe_from_table
from tests.runtime.logs import csv_text, motion, written


def test_recipe_with_a_rate_or_column_numbers(tmp_path):
    """Oracle: a log without a clock takes the stated rate; one without a header, column numbers."""
    t, q, dq = motion()
    path = written(tmp_path, csv_text(t, q, dq).replace("t,q1", "x,q1", 1))
    recording = read_recording(path, recipe_from_table({"time": {"rate_hz": 50.0}}))
    np.testing.assert_allclose(recording.t, 2 * t, atol=1e-12)
    assert recording.dq is None or any("0.5 at joint 1" in s for s in recording.history)
    bare = written(tmp_path, "started\n" + csv_text(t, q, dq).split("\n", 1)[1], "bare.csv")
    table = {"time": {"column": 0, "unit": "s"}, "position": {"columns": [2, 1], "unit": "rad"}}
    swapped = read_recording(bare, recipe_from_table(table))
    assert np.array_equal(swapped.q, q[:, ::-1])
    assert swapped.recipe is not None


def test_recipe_picks_joints_of_an_array(tmp_path):
    """Property: columns beside a key are the numbers of the array, in their order, or refused."""
    t, q, _ = motion()
    np.savez(tmp_path / "log.npz", t=t, q=q)
    table = {"time": {"key": "t", "unit": "s"}, "position": {"key": "q", "unit": "rad"}}
    table["position"]["columns"] = [1, 0]
    picked = read_recording(tmp_path / "log.npz", recipe_from_table(table))
    assert np.array_equal(picked.q, q[:, ::-1])
    for wrong in (["q1"], [2]):
        table["position"]["columns"] = wrong
        with pytest.raises(RecordingError, match=f"has 2 numbers per row.*{wrong[0]}"):
            read_recording(tmp_path / "log.npz", recipe_from_table(table))


def raw_folder(tmp_path: Path, order: tuple[int, ...] = (0, 1)) -> Path:
    t, q, _ = motion()
    written(tmp_path, "\n".join(f"{x:.17g}" for x in np.rad2deg(q).ravel()), "q.txt")
    tau = np.stack([np.cos(t), np.sin(t)], axis=1)[:, order]
    written(tmp_path, csv_text(t, tau, tau, header="ms,a,b,c,d,e,f"), "tau.csv")
    return tmp_path


def gear_recipe(**torque: object) -> Recipe:
    return recipe_from_table(
        {
            "time": {"rate_hz": 100.0},
            "position": {
                "file": "q.txt",
                "layout": "flat",
                "width": 2,
                "unit": "deg",
                "offset": [90.0, 0.0],
            },
            "torque": {"file": "tau.csv", "columns": ["a", "b"], "unit": "N*m", **torque},
            "gear": {"matrix": [[2.0, 0.0], [1.0, -4.0]]},
        }
    )


def test_recipe_settles_units_order_sign_and_gear(tmp_path):
    """Oracle: q = R⁻¹x + offset and τ = Rᵀx by hand, with degrees, another order and a sign."""
    t, q, _ = motion()
    recipe = gear_recipe(order=[1, 0], sign=[1, -1])
    recording = read_recording(raw_folder(tmp_path), recipe)
    x = np.stack([np.sin(t), -np.cos(t)], axis=1)
    expected_q = np.stack([q[:, 0] / 2, (q[:, 0] / 2 - q[:, 1]) / 4], axis=1)
    np.testing.assert_allclose(recording.q, expected_q + np.array([np.pi / 2, 0.0]), atol=1e-14)
    np.testing.assert_allclose(
        recording.tau, np.stack([2 * x[:, 0] + x[:, 1], -4 * x[:, 1]], axis=1), atol=1e-14
    )
    assert recording.rate_hz == pytest.approx(100.0)
    assert any("gear" in s and "signs" in s and "reordered" in s for s in recording.history)
    assert recording.recipe is recipe


def test_power_is_the_same_on_both_sides_of_the_gear(tmp_path):
    """Property: τᵀdq = τ_mᵀdq_m, the principle of virtual work, for the matrices of a recipe."""
    t, q, dq = motion()
    np.savez(tmp_path / "m.npz", t=t, q=q, dq=dq, tau=np.cos(q))
    recipe = recipe_from_table({"gear": {"matrix": [[30.0, 0.0], [20.0, -50.0]]}})
    recording = read_recording(tmp_path / "m.npz", recipe)
    motor = np.sum(np.cos(q) * dq, axis=1)
    np.testing.assert_allclose(np.sum(recording.tau * recording.dq, axis=1), motor, atol=1e-13)


def test_files_of_unlike_length_and_bad_flat_lines(tmp_path):
    """Oracle: a bad number spoils its sample only; a cut file costs its last samples."""
    folder = raw_folder(tmp_path)
    lines = (folder / "q.txt").read_text().splitlines()
    lines[21] = "1.2.3"
    written(folder, "\n".join(["# started", *lines[:-3]]), "q.txt")
    recording = read_recording(folder, gear_recipe())
    assert len(recording) == 397
    np.testing.assert_allclose(np.diff(recording.t)[9], 0.02)
    told = " ".join(recording.history)
    assert "Dropped 3 of 400 rows" in told
    assert "last sample was cut short" in told
    written(folder, "\n".join(lines[:100]), "q.txt")
    with pytest.raises(RecordingError, match="position 50, torque 400"):
        read_recording(folder, gear_recipe())


def test_folder_with_its_own_recipe_and_missing_file(tmp_path):
    """Property: recipe.toml inside a folder is found, and a file it names must be there."""
    t, q, _ = motion()
    np.savez(tmp_path / "run7.npz", stamp=1e3 * t, angle=q)
    text = """
    run = "7"
    [time]
    file = "run{run}.npz"
    key = "stamp"
    unit = "ms"
    [position]
    file = "run{run}.npz"
    key = "angle"
    unit = "rad"
    """
    written(tmp_path, text, "recipe.toml")
    recording = read_recording(tmp_path)
    np.testing.assert_allclose(recording.t, t, atol=1e-15)
    assert recording.name == tmp_path.name
    with pytest.raises(RecordingError, match=r"cannot read run8.npz .*No such file"):
        read_recording(tmp_path, run="8")
    one = read_recording(tmp_path / "run7.npz", tmp_path / "recipe.toml")
    assert np.array_equal(one.q, q)


def test_changed_published_file_is_told(tmp_path):
    """Property: bytes that are not the pinned ones are a warning in the history."""
    t, q, dq = motion()
    path = written(tmp_path, csv_text(t, q, dq))
    table = {"name": "x", "source": {"sha256": {"log.csv": "0" * 64}}}
    recording = read_recording(path, recipe_from_table(table))
    assert "not the published file that recipe 'x' pins" in recording.history[-1]


def test_a_negated_signal_has_the_opposite_offset(tmp_path):
    """Oracle: τ with signs and offsets, times −1; offsets are added after the sign."""
    folder = raw_folder(tmp_path)
    for words in ({"sign": [1, -1], "offset": [0.5, 0.0]}, {"offset": -2.0}, {"sign": -1}):
        recipe = gear_recipe(**words)
        assert recipe.torque is not None
        turned = recipe.replace(torque=recipe.torque.signed(-1.0))
        seen, opposite = (read_recording(folder, each).tau for each in (recipe, turned))
        assert np.array_equal(opposite, -seen)
