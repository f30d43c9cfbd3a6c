"""How the document's experiments are run: chunks, kills, locks, a full disk, Ctrl-C."""

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.experiments import IDS, STUDIES, Request, reproduce, state_of, study_of, valid_result
from runtime.experiments.storage import NAME, locked, missing, read_rows, read_series, write_rows
from runtime.experiments.study import Row
from runtime.library import Library
from tests.conftest import REPOSITORY
from tests.runtime import small
from tests.runtime.conftest import Command
from tests.runtime.small import rows_of

pytest.importorskip("pyarrow", reason="pip install 'symgen[experiments]'")


@pytest.fixture(scope="module")
def designs(lib: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The excitation study alone, small; read only."""
    out = tmp_path_factory.mktemp("designs")
    with small.small():
        reproduce(lib, STUDIES["excitation"], Request(out))
    return out


@pytest.fixture
def begun(designs: Path, tmp_path: Path) -> Path:
    """A folder in which only the designs are there."""
    shutil.copytree(designs, tmp_path / "out")
    return tmp_path / "out"


def test_a_killed_run_goes_on_to_the_same_digits(lib: Library, begun: Path, tmp_path: Path) -> None:
    """Property: SIGKILL after some chunks, the rest in other chunks and threads; bit for bit."""
    trials, alone = 10, tmp_path / "alone"
    shutil.copytree(begun, alone)
    words = [lib.folder, begun, "noise", trials, 1]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.runtime.small", *map(str, words)],
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    chunks, deadline = begun / "noise" / "chunks", time.monotonic() + 300
    while len(list(chunks.glob("*.parquet"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = {path.name: path.stat().st_mtime_ns for path in chunks.glob("*.parquet")}
    assert 2 <= len(kept) < trials
    assert valid_result(begun / "noise") is None
    with small.small(4):
        reproduce(lib, STUDIES["noise"], Request(begun, trials, threads=2))
    with small.small():
        reproduce(lib, STUDIES["noise"], Request(alone, trials, threads=1))
    assert {name: (chunks / name).stat().st_mtime_ns for name in kept} == kept
    assert rows_of(begun, "noise") == rows_of(alone, "noise")
    ours, theirs = read_series(begun / "noise"), read_series(alone / "noise")
    assert all(np.array_equal(ours[name], theirs[name]) for name in theirs)


def test_more_trials_extend_the_fewer(lib: Library, begun: Path, tmp_path: Path) -> None:
    """Property: chunks of a smaller run stay; the hash does not know the number of trials."""
    other = tmp_path / "other"
    shutil.copytree(begun, other)
    with small.small():
        study = STUDIES["ideal"]
        first = reproduce(lib, study, Request(begun, 4))
        kept = (begun / "ideal" / "chunks" / "00000-00003.parquet").stat().st_mtime_ns
        second = reproduce(lib, study, Request(begun, 6))
        reproduce(lib, study, Request(other, 6))
    assert (begun / "ideal" / "chunks" / "00000-00003.parquet").stat().st_mtime_ns == kept
    assert first["config_hash"] == second["config_hash"]
    assert rows_of(begun, "ideal") == rows_of(other, "ideal")


def test_a_chunk_of_another_config_is_none(tmp_path: Path) -> None:
    """Property: rows come back to the bit, for the hash that they were written with alone."""
    rows: list[Row] = [
        {"case": "a", "method": "m", "trial": 3, "airm": 0.1 + 0.2, "curve": [1 / 3, 2.0]},
        {"case": "b", "method": "m", "trial": 3, "consistent": True, "status": "ends"},
    ]
    write_rows(rows, tmp_path / "x.parquet", "hash")
    assert read_rows(tmp_path / "x.parquet", "hash") == rows
    assert read_rows(tmp_path / "x.parquet", "other") is None


def test_missing_trials_in_any_pattern() -> None:
    """Property: every missing trial once, in runs that end at multiples of the size."""
    assert missing([], 5, 2) == [range(2), range(2, 4), range(4, 5)]
    assert missing([0, 3], 6, 4) == [range(1, 3), range(4, 6)]
    assert missing([0], 6, 4) == [range(1, 4), range(4, 6)]
    assert missing(range(9), 9, 4) == []
    rng = np.random.default_rng(0)
    for _ in range(50):
        have = set(rng.integers(0, 40, 15).tolist())
        runs = missing(have, 37, 5)
        assert [n for run in runs for n in run] == [n for n in range(37) if n not in have]
        assert all(1 <= len(run) <= 5 for run in runs)


def test_another_config_is_refused_and_fresh_replaces_it(
    lib: Library, begun: Path, tmp_path: Path
) -> None:
    """Property: trials of two seeds never meet in one folder."""
    other = tmp_path / "other"
    shutil.copytree(begun, other)
    with small.small():
        study = STUDIES["model"]
        reproduce(lib, study, Request(begun, seed=1))
        assert state_of(lib, study, Request(begun, seed=1)).word == "done"
        assert state_of(lib, study, Request(begun)).word == "hash differs"
        with pytest.raises(RuntimeFault, match=r"holds trials of another config .*--fresh"):
            reproduce(lib, study, Request(begun))
        reproduce(lib, study, Request(begun, fresh=True))
        reproduce(lib, study, Request(other))
    assert rows_of(begun, "model") == rows_of(other, "model")


def test_one_run_at_a_time_and_no_stale_lock(lib: Library, begun: Path) -> None:
    """Property: the second run names the first; a lock that a dead process left is none."""
    with small.small(), locked(begun / "model"):
        with pytest.raises(RuntimeFault, match=f"process {os.getpid()} is using"):
            reproduce(lib, STUDIES["model"], Request(begun))
        assert not (begun / "model" / "config.json").exists()
    (begun / "model" / NAME).write_text("1\n")
    with small.small():
        reproduce(lib, STUDIES["model"], Request(begun))


def test_a_full_disk_is_one_sentence(lib: Library, begun: Path) -> None:
    """Property: where a file cannot grow the run ends with exit code 2 and without half a file."""
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096));"
        "from runtime.cli import main; main()"
    )
    words = (sys.executable, "-c", code)
    ran = subprocess.run(
        [*words, "reproduce", "tables-B", "--settings", f"robot={lib.folder}", "--out", str(begun)],
        capture_output=True,
        text=True,
        check=False,
        cwd=begun,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    assert ran.returncode == 2, ran.stderr
    assert re.fullmatch(r"runtime: cannot write '[^\n]*' \(File too large\)[^\n]*\n", ran.stderr)
    assert not list((begun / "appendix" / "chunks").iterdir())
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


def test_ctrl_c_keeps_finished_chunks(
    lib: Library, begun: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: exit code 130, one sentence; the next run goes on."""
    with small.small(2):
        study = STUDIES["ideal"]

        def stopped(setting: Any, numbers: range, threads: int) -> list[Row]:
            if numbers.start >= 4:
                raise KeyboardInterrupt
            return study.run(setting, numbers, threads)

        monkeypatch.setitem(IDS, "table-5.2", replace(study, run=stopped))
        rest = ("--settings", f"robot={lib.folder}", "--trials", 6, "--out", begun)
        words = ("reproduce", "table-5.2", *rest)
        ran = command(*words)
        assert ran.code == 130
        assert "complete chunks are kept" in ran.out
        assert len(list((begun / "ideal" / "chunks").glob("*.parquet"))) == 2
        monkeypatch.setitem(IDS, "table-5.2", study)
        draft = begun / "ideal" / "chunks" / ".00004-00005.parquet.1"
        draft.touch()
        listed = command("reproduce", "list", *rest)
        assert draft.exists()  # it may be that of a run
        assert "partial (4 of 6" in " ".join(listed.out.split())
        assert command(*words).code == 0
        assert not draft.exists()


def test_errors_of_the_command_are_one_sentence(
    lib: Library, command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Property: an unknown id, a place that is none, no pyarrow."""
    ran = command("reproduce", "table-9.9", "--settings", f"robot={lib.folder}")
    assert ran.code == 2
    assert "got 'table-9.9'; choose one of" in ran.err
    (tmp_path / "file").write_text("")
    ran = command(
        "reproduce", "tables-B", "--settings", f"robot={lib.folder}", "--out", tmp_path / "file"
    )
    assert ran.code == 2
    assert "choose another place with --out" in ran.err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    ran = command("reproduce", "tables-B", "--settings", f"robot={lib.folder}")
    assert ran.code == 2
    assert "pip install 'symgen[experiments]'" in ran.err
    with pytest.raises(RuntimeFault, match=r"expected an experiment of .*got"):
        study_of("ideal")
