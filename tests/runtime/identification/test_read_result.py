"""`runtime.read_result` as people call it."""

import pytest

import runtime
from runtime.errors import RecordingError


def test_what_is_no_path_is_refused() -> None:
    """Property: a sentence for another type; a path as text is read."""
    with pytest.raises(RecordingError, match="expected the folder of a result, got 3"):
        runtime.read_result(3)  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="cannot read 'nope'"):
        runtime.read_result("nope")
