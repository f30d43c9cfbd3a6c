"""Damaged or foreign results at the door: one sentence, exit code 2, nothing changed."""

from collections.abc import Callable
from pathlib import Path

import pytest

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
    ],
    ids=["cut short", "a list", "words for numbers", "too many numbers"],
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


def test_a_failure_leaves_the_older_result(desk: Desk, command: Command, result: Path) -> None:
    """Property: a bad log on top of a good result changes no byte of it."""
    bad = desk.changed(tau=-desk.log.tau)
    before = digests(desk.folder)
    assert command(*desk.identify(bad)).code == 2
    assert digests(desk.folder) == before
    assert (result / "result.json").exists()
