"""Raw files are hashed while their rows are used; the digest is there when it is needed."""

import copy
import hashlib
import threading

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording.formats import log_format
from runtime.recording.formats.log_format import Digests
from runtime.recording.streamed import open_streamed


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_format, "SMALL", 0)


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
