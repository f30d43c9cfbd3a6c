"""Rows of a fitted log are recognised in other files."""

import numpy as np
import pytest

from runtime.recording import Recording
from runtime.recording.row_marks import row_hashes, row_marks, same_rows, share_of_rows


def of(rng: np.random.Generator, count: int = 4000) -> Recording:
    """A log of two joints with noise."""
    t = np.arange(count) * 1e-3
    q = np.sin(t)[:, None] + rng.normal(0, 1e-3, (count, 2))
    return Recording(t, q, tau=rng.normal(0, 1, (count, 2)))


def test_rows_are_recognised_in_part_and_as_text() -> None:
    """Property: of a half, of printed decimals, of a longer log; not of the same motion again."""
    rng = np.random.default_rng(0)
    log = of(rng)
    marks = row_marks(log)
    half = log.replace(**{key: getattr(log, key)[2000:] for key in ("t", "q", "tau")})
    assert share_of_rows(marks, row_hashes(half)) == 1
    assert share_of_rows(row_marks(half), row_hashes(log)) == pytest.approx(0.5, abs=0.06)
    printed = log.replace(q=np.round(log.q, 5), tau=np.round(log.tau, 5))
    assert share_of_rows(marks, row_hashes(printed)) > 0.7
    again = log.replace(tau=log.tau + rng.normal(0, 1e-2, log.tau.shape))
    assert share_of_rows(marks, row_hashes(again)) == 0
    assert [pair[:2] for pair in same_rows([("a", log), ("b", again), ("c", half)])] == [("a", "c")]
