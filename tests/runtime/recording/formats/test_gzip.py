"""CSV in gzip: read as the text in it, within the decompression limit."""

import gzip

import numpy as np
import pytest

from runtime import read_recording, write_recording
from runtime.errors import RecordingError
from runtime.recording.formats.tables import SLACK


@pytest.fixture
def packed(clean, tmp_path):
    """A log as CSV in gzip, and its text."""
    write_recording(clean, tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_bytes()
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(text))
    return path, text


def test_a_compressed_csv_is_the_csv(packed, clean) -> None:
    """Oracle: the same numbers, bit by bit."""
    log = read_recording(packed[0])
    np.testing.assert_array_equal(log.q, clean.q)
    np.testing.assert_array_equal(log.tau, clean.tau)


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda data, text: data[:-20], "is cut short"),
        (lambda data, text: data[:40] + bytes(40) + data[80:], "is damaged"),
        (lambda data, text: data + data, "holds several gzip members"),
        (lambda data, text: gzip.compress(bytes(2 * SLACK)), "the decompression limit"),
        (lambda data, text: gzip.compress(b""), "is empty"),
    ],
    ids=["cut", "damaged", "members", "bomb", "empty"],
)
def test_damaged_files_are_one_sentence(packed, harm, message) -> None:
    """Property: nothing beyond the limit is expanded."""
    path, text = packed
    path.write_bytes(harm(path.read_bytes(), text))
    with pytest.raises(RecordingError, match=message):
        read_recording(path)


def test_compressed_text_is_not_streamed(packed) -> None:
    """Property: streaming a compressed text is refused by name."""
    from runtime.recording.streamed import open_streamed

    with pytest.raises(RecordingError, match="streamed from uncompressed"):
        open_streamed(packed[0])
