"""A log that stays in its file is identified like one that is held, in constant memory."""

import json
import os
import subprocess
import sys
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.common import threads
from runtime.errors import RecordingError
from runtime.estimators.regression.factor import Statistics, compress, compress_all
from runtime.estimators.regression.samples import samples_of
from runtime.identification import long_logs as blocks
from runtime.identification import long_logs as passes
from runtime.identification.identified import torque_errors
from runtime.identification.identify import identify
from runtime.identification.long_logs import blocks_of, parts_of_log
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split, write_recording
from runtime.recording.formats import csv_format, tables
from runtime.recording.friction.model import columns
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import split
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.settings import JointMotion
from runtime.recording.streamed import open_streamed
from tests.conftest import REPOSITORY
from tests.runtime.conftest import Command
from tests.runtime.motions import moving

PREPARATION = Preparation(
    filter="butterworth", cutoff_hz=20.0, max_gap_s=6e-3, rate_hz=100.0, trim_s=0.1, rest_speed=0.02
)
FRICTION = Friction()


@pytest.fixture(scope="module")
def log(lib: Library) -> Recording:
    """The robot is a tenth heavier than its URDF."""
    return moving(lib, 20_000, payload=0.1 * lib.pi0)


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks, "BLOCK", 2048)
    monkeypatch.setattr(csv_format, "PIECE", 2**20)
    monkeypatch.setattr(tables.Spool, "SMALL", 2**16)


def streamed_factor(path: Path, lib: Library, weights: np.ndarray) -> Statistics:
    train = parts_of_log(open_streamed(path), lib, PREPARATION, FRICTION, Split())["train"]
    assert len(train) > 3
    return compress_all(lib, (samples_of(part, lib) for part in train.recordings()), weights)


@pytest.mark.parametrize("suffix", ["npz", "parquet", "csv"])
def test_the_factor_is_that_of_the_whole_log(lib, log, tmp_path, suffix):
    """Oracle: block by block, RᵀR is that of the part prepared at once, and so is the count.

    1e-9 of the diagonal: what a filter leaves beyond the overlap (1e-13) and rounding, times the
    hundredfold gain of two differentiations at 500 Hz.
    """
    weights = np.linspace(1.0, 2.0, lib.n_joints)
    train = prepare(split(log, Split())[0], PREPARATION, FRICTION, lib=lib)
    whole = compress(lib, samples_of(train, lib), weights)
    write_recording(log, tmp_path / f"x.{suffix}")
    result = streamed_factor(tmp_path / f"x.{suffix}", lib, weights)
    a, b = (s.triangle().T @ s.triangle() for s in (whole, result))
    size = np.sqrt(np.diag(a))
    assert result.n_samples == whole.n_samples
    assert np.abs(a - b) / np.outer(size, size) == pytest.approx(0.0, abs=1e-9)


def test_the_answer_is_that_of_the_whole_log(lib, log, tmp_path):
    """Oracle: the same errors on all test rows, and base parameters within a part of their σ.

    Only the weights differ: they come from windows, which here leave out some of the rows.
    """
    write_recording(log, tmp_path / "x.parquet")
    whole = identify_recording(log, lib, preparation=PREPARATION, friction=FRICTION)
    result = identify_recording(
        open_streamed(tmp_path / "x.parquet"), lib, preparation=PREPARATION, friction=FRICTION
    )
    (before, after), (before_, after_) = torque_errors(whole)[:2], torque_errors(result)[:2]
    assert before_.percent == pytest.approx(before.percent, rel=1e-9)
    assert after_.percent == pytest.approx(after.percent, rel=0.02)
    shift = (result.beta - whole.beta) / whole.uncertainty.beta_sigma
    assert np.abs(shift).max() < 0.3
    assert result.streamed.samples["train"] == len(whole.train)
    assert result.streamed.samples["test"] == len(whole.test)
    assert result.streamed.spans["test"][0] == pytest.approx(whole.test.t[0], abs=0.01)


def test_the_second_fit_is_that_of_the_whole_log(lib, log, tmp_path):
    """Oracle: ols on all rows held in memory; the errors stay those of the training rows.

    ols has no weights of windows, so that both differ by what the filter leaves beyond the overlap
    (1e-13), times the condition of the raw columns.
    """
    write_recording(log, tmp_path / "x.npz")
    same = {"preparation": PREPARATION, "friction": FRICTION}
    whole = identify_recording(log, lib, "ols", refit=True, certify=False, **same)
    file = open_streamed(tmp_path / "x.npz")
    result = identify_recording(file, lib, "ols", refit=True, **same)
    alone = identify_recording(file, lib, "ols", certify=False, **same)
    assert result.beta == pytest.approx(whole.beta, rel=1e-6, abs=1e-8)
    assert result.phi == pytest.approx(whole.phi, rel=1e-6, abs=1e-8)
    assert np.array_equal(result.trained.pi, alone.pi)
    assert np.abs(result.beta - alone.beta).max() > 1e-5
    assert torque_errors(result)[1].overall == torque_errors(alone)[1].overall
    rows = sum(result.streamed.samples[part] for part in ("train", "test"))
    assert result.uncertainty.n_samples == rows
    assert any(f"fitted to all {rows} rows" in note for note in result.notes)


def test_a_joint_that_rests_keeps_its_friction(lib, log, tmp_path):
    """Oracle: friction with a memory in every block is that of the part prepared at once.

    Joint 3 rests from row 2500 to 9000, over three blocks of 2048 rows. Blocks that begin at ζ = 0
    are wrong by 0.72 RMS there; a motion that begins with a jump leaves a hundredth.
    """
    q, dq = log.q.copy(), log.dq.copy()
    q[9000:, 2] += q[2500, 2] - q[9000, 2]
    q[2500:9000, 2], dq[2500:9000, 2] = q[2500, 2], 0.0
    rested = log.replace(q=q, dq=dq)
    write_recording(rested, tmp_path / "x.npz")
    steps, terms = replace(PREPARATION, rest_speed=None), Friction(("dahl", "position"))
    whole = prepare(split(rested, Split())[0], steps, terms, lib=lib)
    train = parts_of_log(open_streamed(tmp_path / "x.npz"), lib, steps, terms, Split())["train"]
    error = np.concatenate([part.columns for part in train.recordings()]) - whole.columns
    size = np.sqrt(np.mean(error**2, axis=0))
    assert size[2].max() < 0.02
    assert np.delete(size, 2, axis=0).max() < 1e-9


def test_the_chosen_friction_is_that_of_the_whole_log(lib, log, tmp_path, monkeypatch):
    """Oracle: the choice of the same log in memory, whose friction has a memory."""
    monkeypatch.setattr(blocks, "BLOCK", 65536)
    dry = columns(JointMotion(log.dq, log.q), Friction(("coulomb", "dahl"), dahl_stroke=0.01))
    dahl = log.replace(tau=log.tau + 2.0 * dry[..., 1])
    write_recording(dahl, tmp_path / "x.npz")
    whole, result = (
        identify(each, lib, preparation=PREPARATION)
        for each in (dahl, open_streamed(tmp_path / "x.npz"))
    )
    assert result.friction == whole.friction
    assert "dahl" in result.friction.columns
    error, other = (torque_errors(each)[1].overall for each in (result, whole))
    assert error == pytest.approx(other, rel=0.02)


def test_blocks_of_two_threads_are_those_of_one(lib, log, tmp_path, monkeypatch):
    """Property: the same rows in the same order, read again from the spool, and the same refusal.

    The file and the spool have one place each: without a lock, threads read rows of others.
    """
    write_recording(log, tmp_path / "x.csv")
    answers = []

    def slow(self, start, count):
        self._file.seek(8 * start)
        time.sleep(1e-3)  # another thread would move the place of the file
        return np.frombuffer(self._file.read(8 * count), dtype=np.float64)

    monkeypatch.setattr(tables.Spool, "read", slow)
    for count in (1, 8):
        monkeypatch.setattr(threads, "cores", lambda count=count: count)
        facts = blocks_of(open_streamed(tmp_path / "x.csv"), lib, PREPARATION, FRICTION)
        assert len(facts) > 8
        first, again = (list(facts.recordings()) for _ in range(2))
        assert [len(a) for a in first] == [len(a) for a in again]
        answers.append([part.required("tau") for part in (*first, *again)])
    for one, two in zip(*answers, strict=True):
        assert np.array_equal(one, two)
    refused = blocks_of(
        open_streamed(tmp_path / "x.csv"), lib, replace(PREPARATION, cutoff_hz=1e4), FRICTION
    )
    with pytest.raises(RecordingError, match="cutoff_hz"):
        list(refused.recordings())


def test_corrupt_rows_and_units_are_corrected_in_every_block(lib, log, tmp_path):
    """Oracle: NaN rows, milliseconds and degrees: the same samples as the reader of whole logs."""
    q = np.degrees(log.q)
    q[[7, 2047, 2048, 9000]] = np.nan
    arrays = {"stamp": 1e6 + log.t * 1e3, "q": q, "dq": log.dq, "tau": -log.tau}
    np.savez(tmp_path / "x.npz", **arrays)
    recipe = recipe_from_table(
        {
            "time": {"key": "stamp", "unit": "ms", "from_zero": True},
            "position": {"key": "q", "unit": "deg"},
            "velocity": {"key": "dq", "unit": "rad/s"},
            "torque": {"key": "tau", "unit": "N*m", "sign": -1},
        }
    )
    facts = blocks_of(open_streamed(tmp_path / "x.npz", recipe), lib, PREPARATION, FRICTION)
    parts = list(facts.recordings())
    whole = prepare(log, PREPARATION, FRICTION, lib=lib)
    t = np.concatenate([part.t for part in parts])
    assert t == pytest.approx(whole.t, abs=1e-9)
    # A row of gap is interpolated linearly: (Δt)² q̈ / 8 of 4 ms and 2 rad/s².
    result = np.concatenate([part.q for part in parts])
    assert np.abs(result - whole.q).max() < 1e-5
    tau = np.concatenate([part.tau for part in parts])
    assert np.abs(tau - whole.tau).max() < 0.1


def test_memory_does_not_grow_with_the_log(lib, tmp_path, monkeypatch):
    """Property: four times the rows take the same memory, to a tenth."""
    monkeypatch.setattr(passes, "WINDOWS", 2)
    peaks = []
    for rows in (12_000, 48_000):
        write_recording(moving(lib, rows), tmp_path / "x.npz")
        tracemalloc.start()
        identify_recording(
            open_streamed(tmp_path / "x.npz"), lib, preparation=PREPARATION, friction=FRICTION
        )
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]


def test_command_streams_and_says_so(lib, log, tmp_path, command: Command):
    """Oracle: --settings stream=true on the command line, and what does not go with it in one
    sentence.
    """
    write_recording(log, tmp_path / "x.parquet")
    (tmp_path / "x.mcap").write_bytes(b"")
    words = (
        "--robot",
        lib.folder,
        "--settings",
        "stream=true",
        "--cutoff",
        "20",
        "--settings",
        "rate=100",
        "--out",
        "out",
    )
    ran = command("identify", "x.parquet", *words, "--friction", "viscous,coulomb")
    assert ran.code == 0, ran.err
    assert "streaming 20000 rows of x" in ran.out
    assert (tmp_path / "out" / "report.html").is_file()
    for extra, message in {
        ("--method", "nn"): "the method nn needs the samples one by one",
        ("--settings", "preset=real"): "a preset with mini-batches needs the samples one by one",
    }.items():
        ran = command("identify", "x.parquet", *words, *extra)
        assert ran.code == 2
        assert message in ran.err
    ran = command("identify", "x.parquet", *words, "--friction", "auto")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert {"viscous", "coulomb"} <= set(facts["friction"]["columns"])
    assert sum("chosen by cross-validation" in note for note in facts["warnings"]) == 1
    ran = command("identify", "x.mcap", *words)
    assert ran.code == 2
    assert "x.mcap is expected to hold messages of sensor_msgs/msg/JointState" in ran.err


def test_arrays_that_cannot_be_read_in_place(tmp_path):
    """Property: compressed, ragged, transposed or lying arrays are one sentence."""
    t = np.arange(50.0)
    q = np.ones((50, 2))
    np.savez_compressed(tmp_path / "x.npz", t=t, q=q)
    with pytest.raises(RecordingError, match="cannot be read row by row"):
        open_streamed(tmp_path / "x.npz")
    np.savez(tmp_path / "x.npz", t=t, q=np.asfortranarray(np.outer(t, [1.0, 2.0])))
    with pytest.raises(RecordingError, match="cannot be read row by row"):
        open_streamed(tmp_path / "x.npz")
    np.savez(tmp_path / "x.npz", t=t, q=q[:40])
    with pytest.raises(RecordingError, match="every signal, but there are 40 and 50"):
        open_streamed(tmp_path / "x.npz")
    np.savez(tmp_path / "x.npz", t=t, q=q)
    data = (tmp_path / "x.npz").read_bytes()
    (tmp_path / "x.npz").write_bytes(data.replace(b"'shape': (50, 2)", b"'shape': (99, 2)"))
    with pytest.raises(RecordingError, match="cannot be read row by row"):
        open_streamed(tmp_path / "x.npz")
    (tmp_path / "x.npz").write_bytes(data[:300])
    with pytest.raises(RecordingError, match="truncated or not an NPZ"):
        open_streamed(tmp_path / "x.npz")


def test_text_is_parsed_in_pieces(log, tmp_path, monkeypatch):
    """Oracle: piece by piece the numbers are those of the whole text; a bad line is left out."""
    few = log.take(slice(0, 300), "few")
    write_recording(few, tmp_path / "x.csv")
    lines = (tmp_path / "x.csv").read_text().splitlines()
    lines[100] = "Segmentation fault"
    lines.insert(200, lines[0])
    (tmp_path / "x.csv").write_text("\n".join(["started", *lines[:-1], lines[-1][:90]]))
    monkeypatch.setattr(csv_format, "PIECE", 5000)
    streamed = open_streamed(tmp_path / "x.csv")
    assert streamed.rows == 300
    result = streamed.block(0, 300)
    good = np.delete(np.arange(300), [99, 299])
    assert np.array_equal(result.t, few.t[good])
    assert np.array_equal(result.tau, few.tau[good])
    monkeypatch.setattr(csv_format, "PIECE", 100)
    with pytest.raises(RecordingError, match="UTF-8 text in lines"):
        open_streamed(tmp_path / "x.csv")


def test_bench_reports_time_and_memory(lib, tmp_path):
    """Property: the script of the README's table runs on a small log and counts all of it."""
    folder = REPOSITORY
    words = ("--json", "--robot", str(lib.folder), "--megabytes", "3", "--kinds", "npz")
    run = subprocess.run(
        [sys.executable, str(folder / "scripts" / "bench_stream"), *words],
        env=os.environ | {"PYTHONPATH": str(folder), "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    (row,) = json.loads(run.stdout)
    assert row["mega_rows"] == 3_000_000 // 176 / 1e6
    assert row["after"] < 0.1 < row["before"]
    assert 50 < row["peak"] < 1000  # MB
    assert not list(tmp_path.iterdir())
