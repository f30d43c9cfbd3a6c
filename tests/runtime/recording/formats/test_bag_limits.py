"""Bags that claim more than they may, foreign files, missing libraries."""

import sys

import pytest

from runtime.errors import RecordingError
from runtime.recording import read_recording


def test_a_chunk_cannot_claim_more_than_it_may(tmp_path):
    """Property: a chunk of a thousand times its size is refused before it is decompressed."""
    import lz4.frame
    from mcap.records import Chunk

    from runtime.recording.formats.bag_messages import _decompressed

    bomb = lz4.frame.compress(b"\0" * 2**24)
    chunk = Chunk("lz4", bomb, 0, 0, 0, 1000)
    with pytest.raises(ValueError, match="a chunk of 1000 bytes holds 1001"):
        _decompressed(chunk)
    chunk.uncompressed_size = 2**40
    with pytest.raises(ValueError, match="states"):
        _decompressed(chunk)


@pytest.mark.parametrize("name", ["x.mcap", "x.bag", "x.db3"])
def test_foreign_files_and_missing_libraries(tmp_path, monkeypatch, name):
    """Oracle: text with the name of a bag is none; a missing library is named with its remedy."""
    path = tmp_path / name
    path.write_text("t,q1\n0,1\n" * 20)
    with pytest.raises(RecordingError, match=r"bag of messages|whole records"):
        read_recording(path)
    for module in ("mcap.stream_reader", "rosbags.rosbag1", "rosbags.rosbag2"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RecordingError, match=r"pip install 'symgen\[logs\]'"):
        read_recording(path)
