"""An MJCF file names other files; none may block the build."""

import os
from pathlib import Path

import pytest

from symgen.chain.mechanism import Mechanism
from symgen.errors import BuildError
from symgen.sources import Source, read_source

pytest.importorskip("mujoco")
BODY = """<body name="a"><joint name="j" type="hinge" axis="0 1 0"/>
<inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body>"""


def source(folder: Path, head: str) -> Source:
    """A robot of one joint that names other files in `head`."""
    path = folder / "robot.xml"
    path.write_text(f"<mujoco>{head}<worldbody>{BODY}</worldbody></mujoco>")
    return Source(path)


@pytest.mark.parametrize(
    ("head", "sentence"),
    [
        ('<include file="pipe"/>', "not a regular file"),
        ('<include file="part.xml"/>', "not a regular file"),
        ('<include file="/dev/zero"/>', "not a regular file"),
        ('<asset><mesh name="m" file="pipe"/></asset>', "not a regular file"),
        ('<compiler meshdir="in"/><asset><mesh name="m" file="pipe2"/></asset>', "regular file"),
        ('<asset><hfield name="h" file="huge" size="1 1 1 1"/></asset>', "more than 256 MiB"),
        ("".join(f'<a file="{k}"/>' for k in range(60_000)), "names more than 50000 files"),
    ],
    ids=["include", "nested", "device", "mesh", "meshdir", "huge", "many"],
)
def test_files_that_block_are_refused(tmp_path: Path, head: str, sentence: str) -> None:
    """Property: one sentence at once; MuJoCo waited for the other end of a pipe for ever."""
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "in" / "pipe2")
    (tmp_path / "part.xml").write_text('<mujoco><include file="pipe"/></mujoco>')
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(2**29)
    with pytest.raises(BuildError, match=sentence):
        read_source(source(tmp_path, head), Mechanism())


def test_included_files_are_read(tmp_path: Path) -> None:
    """Property: beside the main file, from a folder, and a file that includes itself ends."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "part.xml").write_text('<mujoco><option gravity="0 0 -5"/></mujoco>')
    text, _ = read_source(source(tmp_path, '<include file="in/part.xml"/>'), Mechanism())
    assert '<joint name="j"' in text
    with pytest.raises(BuildError, match="already included"):
        read_source(source(tmp_path, '<include file="robot.xml"/>'), Mechanism())
