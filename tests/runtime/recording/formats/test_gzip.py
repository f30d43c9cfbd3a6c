"""CSV in gzip: read as the text in it, within the decompression limit."""

import gzip
import tracemalloc

import numpy as np
import pytest

from runtime import read_recording, write_recording
from runtime.errors import RecordingError
from runtime.recording.formats import text_tables
from runtime.recording.formats.tables import SLACK
from runtime.recording.formats.text_tables import csv_table


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


def test_memory_of_a_table_is_bounded() -> None:
    """Property: short lines, of which gzip holds a thousandfold, become no lists of objects.

    Two numbers and the line number take 24 bytes per line of 9 characters, their arrays grow by an
    eighth, and a piece of lines takes half a megabyte. Lists took 40 times the text.
    """
    text = "t,q1,tau1\n" + "00,00,00\n" * 20_000
    tracemalloc.start()
    table = csv_table(text, ("t", "q1"), "log.csv.gz")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert table.values.shape == (20_000, 2)
    assert peak < 24 / 9 * 1.25 * len(text) + 10**6


def test_a_modest_file_cannot_take_a_gigabyte(packed, monkeypatch) -> None:
    """Property: the limit grows by less than the hundredfold, to which only a bomb expands."""
    monkeypatch.setattr(text_tables, "SLACK", 2**10)
    path, _ = packed
    text = b"".join(b"%d,%s\n" % (k, b"0" * 250) for k in range(2_000))
    path.write_bytes(gzip.compress(text))
    assert 50 < len(text) / path.stat().st_size < 200
    with pytest.raises(RecordingError, match="the decompression limit"):
        read_recording(path)
