"""Raw files are hashed while their rows are used; the digest is there when it is needed."""

import copy
import hashlib
import threading

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import open_streamed
from runtime.recording.formats import digests
from runtime.recording.formats.digests import Digests


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(digests, "SMALL", 0)


def test_a_large_log_is_opened_before_it_is_hashed(large, tmp_path, monkeypatch):
    """Property: opening returns while the hash waits; its digest is that of the file's bytes."""
    np.savez(tmp_path / "x.npz", t=np.arange(50.0), q=np.ones((50, 2)))
    may, file_digest = threading.Event(), hashlib.file_digest

    def late(file, name):
        assert may.wait(10.0), "opening waits for the hash"
        return file_digest(file, name)

    monkeypatch.setattr(hashlib, "file_digest", late)
    log = open_streamed(tmp_path / "x.npz")
    source = log.block(0, 50).source
    may.set()
    digest = hashlib.sha256((tmp_path / "x.npz").read_bytes()).hexdigest()
    assert dict(source) == {"x.npz": digest}
    assert copy.deepcopy(source) == {"x.npz": digest}


def test_a_file_that_breaks_off_is_one_sentence(large, tmp_path, monkeypatch):
    """Property: an error of the disk is raised where the digest is read, with the file's name."""

    def failing(file, name):
        raise OSError(5, "Input/output error")

    (tmp_path / "x.csv").write_text("t,q1\n")
    known = Digests()
    monkeypatch.setattr(hashlib, "file_digest", failing)
    known.of_file("x.csv", tmp_path / "x.csv")
    assert "x.csv" in known
    with pytest.raises(RecordingError, match=r"cannot read x\.csv in .* \(Input/output error\)"):
        known["x.csv"]
    with pytest.raises(RecordingError, match=r"cannot read y\.csv in .* \(No such file"):
        known.of_file("y.csv", tmp_path / "y.csv")


def test_a_pause_lasts_until_its_end_or_until_the_digest_is_needed(large, tmp_path, monkeypatch):
    """Property: no piece is read during a pause, unless the file is too large to be read later."""
    content = bytes(range(256)) * 4096
    (tmp_path / "x.csv").write_bytes(content)
    read, read_piece = [], digests._Pausable.readinto

    def counted(file, buffer):
        read.append(read_piece(file, buffer))
        return read[-1]

    monkeypatch.setattr(digests._Pausable, "readinto", counted)
    running = threading.active_count()
    known = Digests()
    with monkeypatch.context() as patch:
        patch.setattr(digests._Hashing, "start", lambda _: None)
        known.of_file("x.csv", tmp_path / "x.csv")
    hashing = known._entries["x.csv"]
    with known.paused():
        hashing.start()
        hashing.join(0.05)
        assert hashing.is_alive()
        assert not read
    hashing.join(10.0)
    assert threading.active_count() == running
    assert sum(read) == len(content)
    expected = hashlib.sha256(content).hexdigest()
    with known.paused():
        known.of_file("y.csv", tmp_path / "x.csv")
        assert dict(known) == {"x.csv": expected, "y.csv": expected}
    monkeypatch.setattr(digests, "CACHED", 0)
    known.of_file("z.csv", tmp_path / "x.csv")
    with known.paused():
        known._entries["z.csv"].join(10.0)
        assert not known._entries["z.csv"].is_alive()
