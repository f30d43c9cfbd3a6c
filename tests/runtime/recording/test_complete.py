"""Complete recordings: what an identification needs is there and finite."""

import numpy as np
import pytest

from runtime.errors import IdentificationError, RecordingError
from runtime.recording import Recording
from runtime.recording.recording import complete_arrays

T, Q = np.arange(4.0), np.arange(8.0).reshape(4, 2)
WHOLE = Recording(t=T, q=Q, dq=Q + 1, ddq=Q + 2, tau=Q + 3, name="log")


def test_the_signals_are_those_of_the_recording():
    """Oracle: every array is the recording's; without friction there are no columns."""
    data = complete_arrays(WHOLE, "dq", "ddq", "tau")
    for key in ("q", "dq", "ddq", "tau"):
        np.testing.assert_array_equal(data[key], getattr(WHOLE, key))
    assert data["columns"].shape == (4, 2, 0)


def test_rows_need_no_accelerations():
    """Property: what is not asked for may be missing."""
    rows = np.ones((4, 2, 3))
    data = complete_arrays(WHOLE.replace(ddq=None, rows=rows), "dq", "tau", "rows")
    np.testing.assert_array_equal(data["rows"], rows)


def test_what_is_missing_or_not_finite_is_named():
    """Property: the message names the signals that are not there."""
    with pytest.raises(IdentificationError, match=r"'log' has no ddq, tau; let"):
        complete_arrays(WHOLE.replace(ddq=None, tau=None), "dq", "ddq", "tau")
    with pytest.raises(IdentificationError, match="holds NaN or infinite values"):
        complete_arrays(WHOLE.replace(tau=np.full((4, 2), np.nan)), "dq", "ddq", "tau")
    with pytest.raises(RecordingError, match=r"expected ddq in the recording 'log'"):
        WHOLE.replace(ddq=None).required("ddq")
    assert WHOLE.required("tau") is WHOLE.tau
