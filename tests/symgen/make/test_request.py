"""Requests: from the folder back to the request, names and configurations."""

from pathlib import Path

import pytest

from symgen.chain import ChainOptions
from symgen.errors import BuildError, SymgenError
from symgen.make.pipeline import generate
from symgen.make.request import (
    BuildRequest,
    RobotConfig,
    bundled_request,
    read_config,
    request_from_folder,
)
from tests.conftest import TINY_URDF
from tests.robots import DATA


@pytest.mark.parametrize(
    ("file", "options", "config", "project"),
    [
        (None, ChainOptions(), RobotConfig(), False),
        ("tree.urdf", ChainOptions(), RobotConfig(), False),
        ("tree.urdf", ChainOptions(tip="camera"), RobotConfig(home=(0.5,)), True),
        (
            "tree.urdf",
            ChainOptions(locks={"trunk_turn": 0.3, "left_lift": -0.2}),
            RobotConfig(jerk=(9.0, 8.0)),
            False,
        ),
        ("gantry.urdf", ChainOptions(base="rail", tip="quill"), RobotConfig(), False),
        (
            "gantry.urdf",
            ChainOptions(base="carriage", gravity=(0.0, 9.81, 0.0), locks={"turn": 0.7}),
            RobotConfig(acceleration=(1.0, 2.0)),
            False,
        ),
    ],
)
def test_folder_regenerates_itself(
    tmp_path: Path, file: str | None, options: ChainOptions, config: RobotConfig, project: bool
) -> None:
    """Property: what a folder holds is enough to generate the same bytes again."""
    text = (DATA / file).read_text() if file else TINY_URDF
    files, _ = generate(BuildRequest("own", text, options, config, project))
    folder = tmp_path / "own"
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_text(content, encoding="utf-8")
    again, _ = generate(request_from_folder(folder))
    assert again == files


def test_broken_folder_is_named(tiny: Path) -> None:
    """Property: a folder without its manifest or URDF says so."""
    (tiny / "tiny.urdf").unlink()
    with pytest.raises(BuildError, match=r"is not a complete generated folder .*symgen build"):
        request_from_folder(tiny)
    (tiny / "manifest.json").write_text("{}")
    with pytest.raises(BuildError, match="is not a complete generated folder"):
        request_from_folder(tiny)


@pytest.mark.parametrize("name", ["My-Robot", "", "7dof", "a b", "../up", "größe", "a\n", "_x"])
def test_bad_names(name: str) -> None:
    """Property: a name that is no C prefix is refused before anything happens."""
    with pytest.raises(BuildError, match="expected lower-case letters, digits and _"):
        BuildRequest(name, TINY_URDF)


def test_unknown_bundled_robot() -> None:
    """Property: lists what there is."""
    with pytest.raises(BuildError, match=r"called 'r2d2' \(there are fr3, ur5e\)"):
        bundled_request("r2d2")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("colour = [1]", "unknown key 'colour'; known are home, acceleration, jerk"),
        ("home = 1", "home expects a list of finite numbers, one per joint, got"),
        ("home = []", "home expects a list of finite numbers, one per joint, got"),
        ("home = [nan]", r"home\[0\] expects a finite number, got inf or nan"),
        ('jerk = ["fast"]', "jerk expects limits above 0 for every joint, got"),
        ("home = [", "cannot be read as TOML"),
        ("home = [1.0, 2.0]", "gives 2 values for home, the chain has 1 joints: swing"),
    ],
)
def test_bad_configuration(tmp_path: Path, text: str, message: str) -> None:
    """Property: file, key and joints are named."""
    path = tmp_path / "robot.toml"
    path.write_text(text)
    with pytest.raises(SymgenError, match=message):
        generate(BuildRequest("tiny", TINY_URDF, config=read_config(path)))


def test_missing_configuration(tmp_path: Path) -> None:
    """Property: a configuration that is not there, or not text, is one sentence."""
    (tmp_path / "latin.toml").write_bytes(b"source = '\xe9'")
    for name in ("nowhere.toml", "latin.toml"):
        with pytest.raises(BuildError, match="cannot be read as TOML"):
            read_config(tmp_path / name)
