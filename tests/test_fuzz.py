"""Damaged files: read or refused, and the harness itself finds what it is meant to find."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.library import load
from runtime.recording import read_recording
from scripts.fuzzing import run
from scripts.fuzzing.damage import CANARY, drawn
from scripts.fuzzing.doors import DOORS
from tests.conftest import REPOSITORY

COUNT = 6
"""Of each kind; `scripts/fuzz` reads ten thousand in all."""
NEEDED = ("pyarrow", "h5py", "mcap", "rosbags", "trimesh", "mujoco")


def test_damaged_files_are_read_or_refused(tiny_built: Path) -> None:
    """Property: no exception but ours, no hang, no bomb, nothing written, opened or started."""
    for name in NEEDED:
        pytest.importorskip(name, reason="pip install 'symgen[all]'")
    tallies = run.fuzz([*DOORS], COUNT, 7, tiny_built)
    assert {tally.files for tally in tallies.values()} == {COUNT}
    assert {kind: tally.faults for kind, tally in tallies.items() if tally.faults} == {}
    assert sum(tally.refused for tally in tallies.values()) > COUNT * len(DOORS) // 2


BAD_DOOR = """
import ctypes, os, sys, subprocess, time, warnings
from scripts.fuzzing import child, doors
def furnish(folder, lib):
    (folder / "log.csv").write_text("-1")
def read(path, lib):
    folder, index = path.parent, int(path.read_text())
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
        lambda: b"x" * (3 * 10**8) and None,
        lambda: warnings.warn("overflow", RuntimeWarning),
        lambda: half(folder),
        lambda: time.sleep(99),
    ][index]()
def half(folder):
    (folder / doors.OUT).mkdir()
    (folder / doors.OUT / "page").write_text("half a page")
    raise child.RuntimeFault("refused")
doors.DOORS["csv"] = doors.Door("log.csv", furnish, read)
child.drawn = lambda data, file, key, first, count: [b"%d" % (first + k) for k in range(count)]
child.SECONDS, child.PATIENCE, child.RESIDENT = 1.0, 3.0, 10**8
child.main()
"""
OUTCOMES = (
    *("ZeroDivisionError", "MemoryError", "left", CANARY, "subprocess.Popen", "os.system"),
    *("hangs", "kills the process", "takes", "RuntimeWarning", "csv/out/page", "hangs"),
)


def test_the_harness_finds_faults(tiny_built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a reader that does everything a reader must not do, one thing per file."""
    start = run.subprocess.Popen

    def bad(words: list[str], **options: object) -> object:
        return start([sys.executable, "-c", BAD_DOOR, words[3]], **options)

    monkeypatch.setattr(run.subprocess, "Popen", bad)
    reported = []
    tallies = run.fuzz(["csv"], len(OUTCOMES), 0, tiny_built, lambda *said: reported.append(said))
    faults = {fault.index: fault.outcome for fault in tallies["csv"].faults}
    for index, words in enumerate(OUTCOMES):
        assert words in faults[index], faults[index]
    assert [fault for _, fault in reported] == tallies["csv"].faults


def test_same_seed_same_files() -> None:
    """Property: a fault can be looked at again, by kind and index."""
    data = (REPOSITORY / "symgen" / "robots" / "fr3.toml").read_bytes()
    made, again = ([*drawn(data, "fr3.toml", (0, "robot"), 0, 50)] for _ in range(2))
    assert made == again
    assert made[13:33] == [*drawn(data, "fr3.toml", (0, "robot"), 13, 20)]
    assert len(set(made)) > 45
    assert data not in made


def test_a_bomb_is_refused_before_it_is_opened(tmp_path: Path) -> None:
    """Property: 150 MB of zeros in 0.15 MB are refused by the archive's own list."""
    path = tmp_path / "log.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", bytes(150_000_000))
    with pytest.raises(RecordingError, match=r"log\.npz states 150000000 bytes in \d+, beyond"):
        read_recording(path)


def test_empty_texts_of_an_archive_are_none(tmp_path: Path) -> None:
    """Property: an array of no names is like no array of names."""
    t = np.arange(9.0)
    empty = np.array([], dtype="U3")
    np.savez(tmp_path / "log.npz", t=t, q=np.ones((9, 2)), name=empty, history=empty)
    assert read_recording(tmp_path / "log.npz").name == "log"


@pytest.mark.parametrize("kind", ["npz", "ros1", "ros2", "view-dae", "trials"])
def test_good_files_are_the_same_each_time(tiny_built: Path, tmp_path: Path, kind: str) -> None:
    """Property: what is damaged is the same file in every run, so that a fault comes back."""
    lib, door = load(tiny_built), DOORS[kind]
    damaged = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        door.furnish(tmp_path / name, lib)
        damaged.append((tmp_path / name / door.file).read_bytes())
    assert damaged[0] == damaged[1]
