"""runtime.inspection: clean logs raise no alarm, absurd ones end in sentences; the command."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import RecordingError
from runtime.inspection import inspect_log, recipe_text
from runtime.library import Library
from runtime.recording.recipes.recipe_file import load_recipe
from tests.runtime.diagnosis import EXAMPLE, kinds, sentences


def test_the_clean_log_is_clean(lib: Library) -> None:
    """Property: nothing to do; delay, one run and joints of little torque are information."""
    result = inspect_log(EXAMPLE, lib)
    assert sentences(result) == {}
    assert kinds(result) == {"delay", "one_run", "little_torque"}


@pytest.mark.parametrize(
    ("name", "model"),
    [("panda_gaz", "fr3"), ("tx40_figaroh", "tx40"), ("lwr4_flobaroid", "kuka_lwr4")],
)
def test_real_logs_with_their_recipes_are_clean(robot, shared_data: Path, name, model) -> None:
    """Real data: what a bundled recipe handles is no warning."""
    result = inspect_log(shared_data / "data" / name, robot(model), name)
    assert sentences(result) == {}


@pytest.mark.parametrize(
    "changed",
    [*({"rows": rows} for rows in (1, 2, 5, 20, 60)), {"tau": 0.0}, {"q": 1e6}, {"t": 0.0}],
    ids=str,
)
def test_absurd_logs_are_sentences(lib, clean, saved, tmp_path, changed) -> None:
    """Property: too short, silent or absurd logs end in findings, and in a recipe that loads."""
    rows = slice(changed.pop("rows", None))
    arrays = {key: getattr(clean, key)[rows] for key in ("t", "q", "dq", "tau")}
    arrays |= {key: factor * arrays[key] for key, factor in changed.items()}
    result = inspect_log(saved(clean, **arrays), lib)
    assert sentences(result)
    (tmp_path / "r.toml").write_text(recipe_text(result), encoding="utf-8")
    load_recipe(tmp_path / "r.toml")


def test_files_of_another_kind_are_sentences(lib: Library, tmp_path: Path) -> None:
    """Property: an unknown suffix, text without numbers, a folder without logs."""
    for name, text in (("log.dat", "1 2 3"), ("log.csv", "hello\nworld\n"), ("log.npz", "x")):
        (tmp_path / name).write_text(text)
        with pytest.raises(RecordingError, match="expected"):
            inspect_log(tmp_path / name, lib)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="7 joint positions"):
        inspect_log(tmp_path / "empty", lib)


def test_a_torque_of_something_else(lib: Library, clean: Recording, saved) -> None:
    """Property: noise in place of τ is explained by nothing, and no tool is made of it."""
    tau = np.random.default_rng(0).normal(0, 5, clean.tau.shape)
    assert set(sentences(inspect_log(saved(clean, tau=tau), lib))) == {"unexplained"}


def test_command(command, lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: exit codes 0, 1 and 2; recipe, picture and JSON; nothing written on failure."""
    robot = ("--robot", lib.folder)
    fine = command("inspect", EXAMPLE, *robot, "--plot", "log.png")
    assert fine.code == 0, fine.err
    assert "0 error(s), 0 warning(s)" in fine.out
    assert (tmp_path / "log.png").read_bytes().startswith(b"\x89PNG")
    assert command("inspect", EXAMPLE, *robot, "--strict").code == 1

    log = saved(clean, tau=-clean.tau)
    bad = command("inspect", log, *robot, "--recipe-out", "r.toml", "--json")
    assert bad.code == 1, bad.err
    facts = json.loads(bad.out[bad.out.index("{") :])
    sign = next(f for f in facts["findings"] if f["kind"] == "torque_sign")
    assert sign["level"] == "error"
    assert (tmp_path / "r.toml").read_text() == facts["recipe"]
    assert command("inspect", log, *robot, "--recipe", "r.toml").code == 0
    ran = command("identify", log, *robot, "--recipe", "r.toml", "--cutoff", "auto", "--out", "o")
    assert ran.code == 0, ran.err
    notes = json.loads((tmp_path / "o" / "result.json").read_text())["warnings"]
    assert any(note.startswith("cut-off ") for note in notes)

    broken = command("inspect", tmp_path / "none.csv", *robot, "--recipe-out", "no.toml")
    assert broken.code == 2
    assert broken.err.count("\n") == 1
    assert not (tmp_path / "no.toml").exists()
    assert "--cutoff needs" in command("identify", log, *robot, "--cutoff", "high").err
    assert (
        "expected an image file with the suffix"
        in command("inspect", EXAMPLE, *robot, "--plot", "a.bmp").err
    )
