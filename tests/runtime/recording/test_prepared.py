"""Prepared recordings: complete, finite, without optional fields."""

import numpy as np
import pytest

from runtime.errors import IdentificationError, RecordingError
from runtime.recording import Recording
from runtime.recording.prepared import BalancedRecording, DifferentiatedRecording, prepared_of

T, Q = np.arange(4.0), np.arange(8.0).reshape(4, 2)
WHOLE = Recording(t=T, q=Q, dq=Q + 1, ddq=Q + 2, tau=Q + 3, name="log")


def test_the_signals_are_those_of_the_recording():
    """Oracle: every field is the recording's array; without friction there are no columns."""
    data = prepared_of(WHOLE)
    assert isinstance(data, DifferentiatedRecording)
    for key in ("t", "q", "dq", "ddq", "tau"):
        np.testing.assert_array_equal(getattr(data, key), getattr(WHOLE, key))
    assert data.columns.shape == (4, 2, 0)
    assert (len(data), data.name) == (4, "log")


def test_rows_come_before_accelerations():
    """Property: a recording with rows needs no ddq."""
    rows = np.ones((4, 2, 3))
    data = prepared_of(WHOLE.replace(ddq=None, rows=rows))
    assert isinstance(data, BalancedRecording)
    np.testing.assert_array_equal(data.rows, rows)


def test_what_is_missing_or_not_finite_is_named():
    """Property: the message names the signals that are not there."""
    with pytest.raises(IdentificationError, match=r"'log' has no ddq, tau; let"):
        prepared_of(WHOLE.replace(ddq=None, tau=None))
    with pytest.raises(IdentificationError, match="holds NaN or infinite values"):
        prepared_of(WHOLE.replace(tau=np.full((4, 2), np.nan)))
    with pytest.raises(RecordingError, match=r"expected ddq in the recording 'log'"):
        WHOLE.replace(ddq=None).required("ddq")
    assert WHOLE.required("tau") is WHOLE.tau
