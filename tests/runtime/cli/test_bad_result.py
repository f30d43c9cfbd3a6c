"""Damaged or foreign results at the door: one sentence, exit code 2, nothing changed."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime.identification.payload.arm_error import read_arm_model
from tests.runtime.conftest import Command
from tests.runtime.desk import Desk, digests, edit, truncate


@pytest.fixture
def result(desk: Desk, command: Command) -> Path:
    """A good result of the good log."""
    assert command(*desk.identify("good.csv")).code == 0
    return desk.folder / "out"


def test_a_result_of_another_robot(desk: Desk, command: Command, result: Path) -> None:
    """Property: evaluate holds the joints of the result against those of the robot."""
    before = digests(desk.folder)
    ran = command("evaluate", result, "good.csv", "--robot", desk.pendulum.folder)
    assert (ran.code, len(ran.err.splitlines())) == (2, 1)
    assert "identified fr3, whose joints differ from those of 'tiny'" in ran.err
    assert digests(desk.folder) == before


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (truncate, "no valid result.json"),
        (lambda path: path.write_text("[]"), "no valid result.json"),
        (lambda path: edit(path, '"pi": [', '"pi": ["x", '), "no valid result.json"),
        (lambda path: edit(path, '"pi": [', '"pi": [1.0, '), "no valid result.json"),
        (lambda path: edit(path, '"lumped": [', '"lumps": ['), "no valid result.json"),
        (lambda path: edit(path, '"gravity": [', '"gravity": [1.0, '), "no valid result.json"),
    ],
    ids=["cut short", "a list", "words for numbers", "too many numbers", "no lumps", "4 axes"],
)
def test_a_damaged_result(
    desk: Desk, command: Command, result: Path, damage: Callable[[Path], object], match: str
) -> None:
    """Property: evaluate reads nothing but what identify wrote."""
    damage(result / "result.json")
    before = digests(desk.folder)
    ran = command("evaluate", result, "good.csv", "--robot", desk.lib.folder)
    assert (ran.code, len(ran.err.splitlines())) == (2, 1), ran
    assert match in ran.err
    assert digests(desk.folder) == before


def test_a_report_of_a_damaged_uncertainty(desk: Desk, command: Command, result: Path) -> None:
    """Property: three numbers are the σ of a centre of mass; else one sentence, no traceback."""
    facts = json.loads((result / "result.json").read_text())
    links = facts["uncertainty"]["links"]
    (links[0] if isinstance(links, list) else next(iter(links.values())))["com_sigma"] = []
    (result / "result.json").write_text(json.dumps(facts))
    ran = command("report", result, "--out", desk.folder / "page.html")
    assert (ran.code, len(ran.err.splitlines())) == (2, 1), ran
    assert "uncertainty.links[0].com_sigma expects a list of length 3, got []" in ran.err
    assert not (desk.folder / "page.html").exists()


def test_a_failure_leaves_the_older_result(desk: Desk, command: Command, result: Path) -> None:
    """Property: a bad log on top of a good result changes no byte of it."""
    bad = desk.changed(tau=-desk.log.tau)
    before = digests(desk.folder)
    assert command(*desk.identify(bad)).code == 2
    assert digests(desk.folder) == before
    assert (result / "result.json").exists()


def changed(result: Path, change: Callable[[dict], object]) -> None:
    """Make a result that was identified with another model."""
    facts = json.loads((result / "result.json").read_text())
    facts["model"]["model_hash"] = "0" * 64
    change(facts["model"])
    (result / "result.json").write_text(json.dumps(facts))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda model: None,
            "identified with another build of this arm (model 000000000000, 'fr3' has",
        ),
        (
            lambda model: model.update(gravity=[9.81, 0.0, 0.0]),
            "was identified with gravity 9.81,0,0, and 'fr3' has 0,0,-9.81",
        ),
        (lambda model: model.update(lumped=["hand"]), "other fixed links counted into moving ones"),
    ],
    ids=["build", "gravity", "lumped"],
)
def test_another_model_is_told(
    desk: Desk, command: Command, result: Path, change: Callable[[dict], object], said: str
) -> None:
    """Property: what leaves the frames of π alone is a note; export refuses other bodies."""
    same = command("evaluate", result, "good.csv", "--robot", desk.lib.folder, "--json")
    (note,) = json.loads(same.out)["notes"]
    assert note.startswith("the model was fitted to 100 % of the rows of this log")
    assert json.loads(same.out)["mass_matrix"]["is_positive_definite"]
    changed(result, change)
    ran = command("evaluate", result, "good.csv", "--robot", desk.lib.folder)
    assert ran.code == 0
    assert said in ran.out
    ran = command("export", result, "--to", "header", "--robot", desk.lib.folder)
    assert said in (ran.err if "links" in said else ran.out)
    assert ran.code == (2 if "links" in said else 0)
    read = read_arm_model(result, desk.lib)
    assert said in read.origin


@pytest.mark.parametrize(
    "change",
    [
        lambda model: model["joints"][2]["translation"].__setitem__(1, 1e-3),
        lambda model: model["joints"][2].update(kind="prismatic"),
        lambda model: model["joints"][2].update(axis=[0.0, 0.0, -1.0]),
    ],
    ids=["a millimetre", "kind", "sign"],
)
def test_joints_that_sit_elsewhere(
    desk: Desk, command: Command, result: Path, change: Callable[[dict], object]
) -> None:
    """Property: parameters in other frames are refused by all that compute with them."""
    changed(result, change)
    before = digests(desk.folder)
    robot = ("--robot", desk.lib.folder)
    for words in (
        ("evaluate", result, "good.csv"),
        ("export", result),
        ("payload", "good.csv", "--model", result),
    ):
        ran = command(*words, *robot)
        assert (ran.code, len(ran.err.splitlines())) == (2, 1), ran
        assert "joint 'fr3_joint3' sits or turns differently than that of 'fr3'" in ran.err
    assert digests(desk.folder) == before
