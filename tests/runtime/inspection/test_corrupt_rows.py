"""Rows that stay wrong for a while, and rows lost from a log that also repeats states."""

import numpy as np
import pytest

from runtime.inspection import inspect_log
from runtime.inspection.checks.clock import lost_beside_repeats
from runtime.inspection.checks.outlying_rows import outlying_rows
from runtime.library import Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import unwrap

FIRST, LAST = 1200, 1240


@pytest.fixture(scope="module")
def log(double: Library) -> Recording:
    """20 s at 200 Hz of two joints, with one row missing just behind the rows to be damaged."""
    t = np.arange(4000) / 200.0
    t[LAST:] += 1.0 / 200.0
    angle = 0.7 * t[:, None] * [1.0, 1.7] + [0.0, 1.0]
    q, dq = np.sin(angle), 0.7 * np.cos(angle) * [1.0, 1.7]
    ddq = -((0.7 * np.array([1.0, 1.7])) ** 2) * q
    return Recording(t=t, q=q, dq=dq, tau=double.inverse_dynamics(q, dq, ddq, double.pi0))


def spans(log: Recording, lib: Library) -> list[list[float]]:
    findings = outlying_rows(log, Recipe(), lib)[1]
    return [span for finding in findings for span in finding.evidence["spans_s"]]


def test_positions_that_are_displaced_for_a_while(log: Recording, double: Library) -> None:
    """Property: 40 rows with 0.3 rad more; their end lies beside a gap of the clock.

    Two rows more at both ends are left out.
    """
    q = log.q.copy()
    q[FIRST:LAST, 1] += 0.3
    (span,) = spans(log.replace(q=q), double)
    np.testing.assert_array_equal(span, log.t[[FIRST - 2, LAST + 1]])
    # The motion itself, with the same gap, has none.
    assert spans(log, double) == []


def test_a_gap_in_which_the_arm_moves_on(log: Recording, double: Library) -> None:
    """Property: a second without rows twice, the arm elsewhere and back behind them."""
    kept = np.ones(len(log), dtype=bool)
    kept[600:800] = kept[810:1010] = False
    assert spans(log.take(kept, ""), double) == []


def test_torques_beyond_the_limit_for_a_while(log: Recording, double: Library) -> None:
    """Property: 40 rows of four times the limit of effort; a log in mN·m has no such row."""
    tau, effort = log.tau.copy(), double.limits()["effort"]
    tau[FIRST:LAST, 0] = 4.0 * effort[0]
    (span,) = spans(log.replace(tau=tau), double)
    np.testing.assert_array_equal(span, log.t[[FIRST - 2, LAST + 1]])
    assert spans(log.replace(tau=1e3 * log.tau), double) == []


def test_corrupt_rows_are_no_motor_angles(log: Recording, double: Library, tmp_path) -> None:
    """Property: rows shifted by half a row, of which one jump is nearly a turn, are outliers; the
    positions behind them keep their place, and the other checks see no fault.
    """
    q, dq = log.q.copy(), log.dq.copy()
    q[FIRST:LAST], dq[FIRST:LAST] = dq[FIRST:LAST].copy(), q[FIRST:LAST].copy()
    q[LAST - 1, 0] = q[LAST, 0] + 2 * np.pi - 0.3
    np.savez(tmp_path / "log.npz", t=log.t, q=q, dq=dq, tau=log.tau)
    found = inspect_log(tmp_path / "log.npz", double)
    assert "outliers" in [f.kind for f in found.findings]
    assert "position_range" not in [f.kind for f in found.findings]
    assert np.abs(found.recording.q).max() <= 1.0


def test_a_jump_is_a_turn_only_to_within_the_steps_of_the_joint() -> None:
    """Oracle: 1 kHz, steps below 1 mrad: 2π is a turn, 2π − 0.3 is a corrupt row."""
    q = np.sin(np.arange(1000) / 1000.0)[:, None]
    for turn, count in ((2 * np.pi, 1), (2 * np.pi - 0.3, 0)):
        jumped = q + np.where(np.arange(1000) < 500, 0.0, turn)[:, None]
        assert unwrap(jumped)[1].tolist() == [count]


@pytest.mark.parametrize("every", [0, 20])
def test_rows_lost_from_a_log_that_repeats_states(
    log: Recording, double: Library, tmp_path, every: int
) -> None:
    """Oracle: an asynchronous logger repeats every 16th state and skips as many; every 20th row is
    lost before the rows are stamped anew. Without the loss nothing is reported.
    """
    rows = np.arange(4000)
    rows[rows % 16 == 5] -= 1
    kept = rows[np.arange(4000) % every != 7] if every else rows
    arrays = {key: getattr(log, key)[kept] for key in ("q", "dq", "tau")}
    np.savez(tmp_path / "log.npz", t=np.arange(len(kept)) / 200.0, **arrays)
    findings = {f.kind: f for f in inspect_log(tmp_path / "log.npz", double).findings}
    assert findings["repeated_rows"].evidence["skipped_ticks"] > 0
    assert ("restamped" in findings) == bool(every)
    if every:
        assert findings["restamped"].evidence["share"] == pytest.approx(1 / 19, rel=0.05)


def test_an_interval_that_is_left_out_holds_no_lost_rows() -> None:
    """Oracle: 100 of 1100 ticks are a gap of the clock, which the count of skipped ticks holds."""
    t = np.arange(1000) * 1e-3
    t[500:] += 0.1
    log = Recording(t=t, q=np.sin(t)[:, None])
    assert lost_beside_repeats(log, 40, 140) == []
    (finding,) = lost_beside_repeats(log, 40, 190)
    assert finding.evidence["share"] == pytest.approx(0.05)
