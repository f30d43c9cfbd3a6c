"""Damaged files: read or refused, and the harness itself finds what it is meant to find."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import read_recording
from scripts.fuzzing import run
from scripts.fuzzing.doors import DOORS
from scripts.fuzzing.mutators import CANARY, mutated
from tests.conftest import REPOSITORY

FILES = 680
"""40 of each kind; `scripts/fuzz` reads ten thousand."""


def test_damaged_files_are_read_or_refused(tiny_built: Path) -> None:
    """Property: no exception but ours, no hang, no bomb, nothing written, opened or started."""
    pytest.importorskip("pyarrow", reason="pip install 'symgen[logs]'")
    tallies = run.fuzz([*DOORS], FILES, 7, tiny_built)
    assert sum(tally.files for tally in tallies.values()) == FILES
    assert {kind: tally.faults for kind, tally in tallies.items() if tally.faults} == {}
    assert sum(tally.refused for tally in tallies.values()) > FILES // 2
    assert max(tally.memory for tally in tallies.values()) < 5e8


BAD_DOOR = """
import ctypes, os, sys, subprocess, time
from scripts.fuzzing import child, doors
def read(folder, lib):
    index = int((folder / "log.csv").read_text())
    if index < 0:
        return
    [
        lambda: 1 / 0,
        lambda: [0] * 10**10,
        lambda: (folder / "left").write_text("over"),
        lambda: open(folder.parent / child.CANARY).close(),
        lambda: subprocess.run(["true"]),
        lambda: os.system("true"),
        lambda: exec("while True: pass"),
        lambda: ctypes.string_at(0),
    ][index]()
doors.DOORS["csv"] = doors.Door("log.csv", read)
child.furnish = lambda kind, folder, lib: (folder.mkdir(), (folder / "log.csv").write_text("-1"))
count = iter(range(int(sys.argv[2]), 99))
child.mutated = lambda data, suffix, rng: b"%d" % next(count)
child.SECONDS = 0.5
child.main()
"""


def test_the_harness_finds_faults(tiny_built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a reader that does everything a reader must not do, one thing per file."""
    start = run.subprocess.Popen

    def bad(words: list[str], **options: object) -> object:
        first = run.json.loads(words[3])["work"][0][1]
        return start([sys.executable, "-c", BAD_DOOR, words[3], str(first)], **options)

    monkeypatch.setattr(run.subprocess, "Popen", bad)
    faults = dict(run.fuzz(["csv"], 8, 0, tiny_built)["csv"].faults)
    for index, words in enumerate(
        ("ZeroDivisionError", "MemoryError", "left", CANARY, "subprocess.Popen", "os.system")
    ):
        assert words in faults[index], faults[index]
    assert "hangs" in faults[6]
    assert "kills the process" in faults[7]


def test_same_seed_same_files() -> None:
    """Property: a fault can be looked at again, by kind and index."""
    data = (REPOSITORY / "symgen" / "robots" / "fr3.toml").read_bytes()
    made = [mutated(data, ".toml", np.random.default_rng([0, 1, i])) for i in range(50)]
    again = [mutated(data, ".toml", np.random.default_rng([0, 1, i])) for i in range(50)]
    assert made == again
    assert len(set(made)) > 45
    assert data not in made


def test_a_bomb_is_refused_before_it_is_opened(tmp_path: Path) -> None:
    """Property: 150 MB of zeros in 0.15 MB are told by the archive's own list."""
    path = tmp_path / "log.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", bytes(150_000_000))
    with pytest.raises(RecordingError, match=r"log\.npz claims 150000000 bytes in \d+, which no"):
        read_recording(path)


def test_empty_texts_of_an_archive_are_none(tmp_path: Path) -> None:
    """Property: an array of no names is like no array of names."""
    t = np.arange(9.0)
    empty = np.array([], dtype="U3")
    np.savez(tmp_path / "log.npz", t=t, q=np.ones((9, 2)), name=empty, history=empty)
    assert read_recording(tmp_path / "log.npz").name == "log"
