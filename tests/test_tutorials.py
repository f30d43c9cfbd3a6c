"""The tutorials do what they say: every block runs, and prints what is shown behind it."""

import re
import shutil
from pathlib import Path

import pytest

from runtime.cli.bundled import FOLDER, tutorial_command
from runtime.errors import RuntimeFault
from runtime.library import Library
from tests.markdown import blocks, require_shown, run, shows

NAMES = ("fr3", "own-robot", "payload", "realtime", "z1")
FILE = re.compile(r"[\w.]+\.(?:toml|urdf|c)\b")


@pytest.fixture
def desk(tmp_path: Path, fr3: Library, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder; the FR3 is there, so that it need not be compiled again."""
    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / "fr3").symlink_to(fr3.folder)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", NAMES)
def test_a_tutorial_runs(
    name: str, desk: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    """Oracle: commands, interpreter and compiler; what is shown is printed, to its digits."""
    if name == "z1":
        data = request.getfixturevalue("shared_data") / "data" / "unitree_air"
        (desk / "z1.npz").symlink_to(data / "z1.npz")
        library = request.getfixturevalue("robot")("unitree_z1")
        (desk / "generated" / "unitree_z1").symlink_to(library.folder)
    if name == "realtime" and shutil.which("cc") is None:
        pytest.skip("SKIPPED LOUDLY: no C compiler called cc on this machine")
    printed = ""
    for language, block in blocks((FOLDER / f"{name}.md").read_text(encoding="utf-8")):
        if language in {"bash", "python"}:
            printed = run(language, block, capsys)
        elif language == "text":
            require_shown(block, printed)
        else:
            (desk / FILE.findall(block)[0]).write_text(block, encoding="utf-8")


def test_parts_of_the_tutorials() -> None:
    """Property: the names above are those of the package, and each has all of its parts."""
    texts = {path.stem: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.md")}
    assert texts.keys() == set(NAMES)
    for name, text in texts.items():
        kinds = {language for language, _ in blocks(text)}
        assert kinds <= {"bash", "python", "text", "toml", "xml", "c"}, name
        assert "\n## What can go wrong\n" in text, name


def test_the_command_shows_them(capsys: pytest.CaptureFixture[str]) -> None:
    """Property: titles without a name, Markdown into a pipe, a sentence for a wrong name."""
    listed = run("bash", "python -m runtime tutorial", capsys)
    assert [line.split()[0] for line in listed.splitlines()] == sorted(NAMES)
    text = (FOLDER / "fr3.md").read_text(encoding="utf-8")
    assert run("bash", "python -m runtime tutorial fr3", capsys) == text
    with pytest.raises(RuntimeFault, match="no tutorial 'fr4'; there are fr3, own-robot, payload"):
        tutorial_command("fr4")


def test_numbers_are_compared_to_the_digits_shown() -> None:
    """Property: words and numbers agree; fewer digits and … leave out what machines differ in."""
    printed = "│ link7   │  0.2504 │ 1.9e-05 │ 2500 │"
    for line in ("│ link7 │ 0.250 │ 1.9e-05 │ 2500 │", "│ link7 │ 0.3 │ 2e-05 │ …", printed):
        assert shows(line, printed), line
    for line in ("│ link6 │ 0.250 │ …", "│ link7 │ 0.253 │ …", "│ link7 │ 0.250 │ 4e-05 │ …"):
        assert not shows(line, printed), line
    assert not shows("│ link7 │ 0.250 │ 1.9e-05 │ 2600 │", printed)
