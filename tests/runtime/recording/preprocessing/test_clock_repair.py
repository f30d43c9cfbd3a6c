"""Clocks repaired and changed: exact on clocks known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runtime.errors import RecordingError
from runtime.recording import Recording
from runtime.recording.preprocessing.filters import low_pass, moving_average, savitzky_golay
from runtime.recording.preprocessing.segments import decimate, repair_clock, resample, segments
from tests.runtime.signals import sine, with_hole


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    repeats=st.floats(0.0, 0.2),
    skips=st.floats(0.0, 0.2),
    quantum=st.sampled_from([0.0, 1e-6]),
)
def test_clock_repair_recovers_the_exact_clock(seed, repeats, skips, quantum):
    """Property: a 1 kHz motion logged with repeats, skips and jitter gets its own clock back."""
    rng = np.random.default_rng(seed)
    truth = np.arange(3000) * 1e-3
    kept = rng.random(3000) >= skips
    kept[0] = True
    truth = truth[kept]
    q = np.stack([np.sin(2 * truth), 0.8 * np.cos(3 * truth)], axis=1)
    dq = np.stack([2 * np.cos(2 * truth), -2.4 * np.sin(3 * truth)], axis=1)
    if quantum:
        q = np.round(q / quantum) * quantum
    again = np.repeat(np.arange(len(truth)), 1 + (rng.random(len(truth)) < repeats))
    stamps = truth[again] + 1e-3 * (np.diff(again, prepend=-1) == 0)
    stamps = np.sort(stamps + rng.uniform(0.0, 0.8e-3, len(again)))
    stamps += 1e-7 * np.arange(len(again))
    log = Recording(t=stamps, q=q[again], dq=dq[again], tau=rng.normal(size=(len(again), 2)))
    fixed = repair_clock(log, 1e-3)
    assert len(fixed) == len(truth)
    np.testing.assert_allclose(fixed.t - fixed.t[0], truth - truth[0], atol=1e-9)


def test_clock_at_rest_follows_the_log():
    """Oracle: where the robot stands (q still changes by noise) the logged time counts ticks."""
    rng = np.random.default_rng(2)
    t = np.arange(2000) * 1e-3
    t = np.delete(t, rng.choice(np.arange(1, 1999), 300, replace=False))
    q = np.stack([1e-6 * rng.normal(size=len(t)), np.ones(len(t))], axis=1)
    dq = 1e-3 * rng.normal(size=q.shape)
    jittered = t + rng.uniform(-2e-4, 2e-4, len(t))
    fixed = repair_clock(Recording(t=jittered, q=q, dq=dq), 1e-3)
    np.testing.assert_allclose(fixed.t - fixed.t[0], t - t[0], atol=1e-9)


def test_clock_that_cannot_be_is_refused():
    """Property: no dq, no motion, or a dq of other units is told instead of a wrong clock."""
    data = sine(1.0)
    with pytest.raises(RecordingError, match="from dq, but there is none"):
        repair_clock(data.replace(dq=None), 1e-3)
    with pytest.raises(RecordingError, match="never moves"):
        repair_clock(data.replace(q=np.zeros_like(data.q)), 1e-3)
    with pytest.raises(RecordingError, match=r"runs 7\.\d* s, but the log 3.999 s"):
        repair_clock(data.replace(dq=data.dq / 2), 1e-3)


def test_clock_of_a_log_with_lost_rows_begins_where_the_log_does():
    """Oracle: a tenth of the rows lost and stamped at a constant rate: the clock of the motion.

    Where a fifth is lost, more than 15 % of the duration, the log is refused, long or short.
    """
    whole = sine(1.0, seconds=10.0)
    whole = whole.replace(t=whole.t + 50.0)
    kept = np.arange(10000) % 10 != 3
    log = whole.take(kept, "").replace(t=whole.t[: kept.sum()])
    fixed = repair_clock(log, 1e-3)
    np.testing.assert_allclose(fixed.t, whole.t[kept], rtol=0, atol=1e-9)
    few = np.arange(10000) % 5 != 3
    for count in (8000, 400):
        log = whole.take(few, "").take(slice(count), "").replace(t=whole.t[:count])
        with pytest.raises(RecordingError, match="check the units of dq and t"):
            repair_clock(log, 1e-3)


def test_resample_fills_small_gaps_and_keeps_large_ones():
    """Oracle: linear motion comes back exactly on the grid; the hole is where it was."""
    rng = np.random.default_rng(3)
    t = np.arange(1000) * 1e-2 + rng.uniform(-2e-3, 2e-3, 1000)
    t[0] = 0.0
    keep = np.ones(1000, dtype=bool)
    keep[[100, 101, 300]] = False
    keep[500:540] = False
    q = np.stack([2.0 * t, 1.0 - t], axis=1)
    data = resample(Recording(t=t[keep], q=q[keep]), 100.0, 0.05)
    np.testing.assert_allclose(data.q, np.stack([2 * data.t, 1 - data.t], axis=1), atol=1e-12)
    np.testing.assert_allclose(data.t * 100.0, np.round(data.t * 100.0), atol=1e-9)
    assert len(segments(data.t)) == 2
    assert "1 longer ones kept" in data.history[0]
    assert len(data) >= 958
    with pytest.raises(RecordingError, match=r"more than 1\.5 steps"):
        resample(data, 100.0, 0.015)


def test_decimate_keeps_one_clock_for_all_segments():
    """Oracle: instants are multiples of the new step, before and after a hole; values unchanged."""
    data = with_hole(sine(1.0), 1.003, 1.777)
    slow = decimate(data, 100.0)
    np.testing.assert_allclose(slow.t * 100.0, np.round(slow.t * 100.0), atol=1e-9)
    np.testing.assert_array_equal(slow.q, data.q[np.isin(data.t, slow.t)])
    assert len(segments(slow.t)) == 2
    assert "Kept every 10. instant" in slow.history[-1]
    other = decimate(sine(1.0), 300.0)
    assert other.rate_hz == pytest.approx(300.0)
    np.testing.assert_allclose(other.q[:, 0], np.sin(2 * np.pi * other.t), atol=1e-5)
    with pytest.raises(RecordingError, match="1000 Hz or less, got 2000 Hz"):
        decimate(data, 2000.0)


def test_uneven_clock_is_never_filtered():
    """Property: filters and decimation refuse a jittering clock and say what to set."""
    rng = np.random.default_rng(4)
    t = np.arange(500) * 1e-2 + rng.uniform(0, 3e-3, 500)
    data = Recording(t=t, q=np.sin(t)[:, None])
    steps = (
        lambda: low_pass(data, 5.0),
        lambda: moving_average(data, 0.1),
        lambda: savitzky_golay(data, 0.1),
        lambda: decimate(data, 20.0),
    )
    for step in steps:
        with pytest.raises(RecordingError, match="set max_gap_s to resample first"):
            step()
    with pytest.raises(RecordingError, match="between 0 and 500 Hz"):
        low_pass(sine(1.0), 500.0)
    with pytest.raises(RecordingError, match="widen window_s"):
        savitzky_golay(sine(1.0), 0.003)
