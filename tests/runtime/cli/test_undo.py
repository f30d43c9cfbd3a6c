"""`symgen undo`: a replaced result comes back, and the newer one with a second undo."""

import json
from pathlib import Path

from runtime.cli.common import ResultFolder
from runtime.cli.identify import IdentifySettings
from tests.runtime.conftest import Command

KIND = ResultFolder(("result.json", "report.html", "statistics.npz"), "method")
GIVEN = IdentifySettings(logs=["log.csv"])


def _content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def test_a_replaced_result_comes_back(command: Command, tmp_path: Path) -> None:
    """Property: all files of the result, none of the user; undone twice is as before."""
    folder = tmp_path / "out"
    folder.mkdir()
    assert command("undo", "out").code == 2
    (folder / "result.json").write_text(json.dumps({"method": "map"}))
    (folder / "report.html").write_text("first")
    first = _content(folder)
    (folder / "notes.txt").write_text("mine")
    KIND.require(folder, GIVEN, overwrite=False)
    KIND.begin(folder, GIVEN)
    (folder / "result.json").write_text(json.dumps({"method": "ols"}))
    (folder / "report.html").unlink()
    (folder / "statistics.npz").write_text("second")
    second = _content(folder)
    assert command("undo", "out").code == 0
    assert _content(folder) == first | {"notes.txt": "mine"}
    assert command("undo", "out").code == 0
    assert _content(folder) == second
