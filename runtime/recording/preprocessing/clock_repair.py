"""Repair of the clock of a log that repeats states and skips ticks, from dq = v · dt.

    k_i = round( Σ_j v_ij Δq_ij / (tick · Σ_j v_ij²) ),  v = mean of dq at both ends,  k_i ≥ 1

is the least-squares number of ticks between two retained rows. Where the robot is too slow for
this estimate, the logged time decides.
"""

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording import Recording
from runtime.recording.preprocessing.segments import runs
from runtime.recording.recording import FloatArray

SLOW = 0.1
MAX_DRIFT = 0.15
"""Largest change of the duration: a log that lost a tenth of its rows and was stamped at a constant
rate is repaired; wrong units differ by factors, and a wrong tick by its whole error."""


def repair_clock(recording: Recording, tick: float, slow: float = SLOW) -> Recording:
    """Drop rows that repeat the previous state and count the ticks between the others.

    A row repeats when no joint has another q than in the row before: the state is stale, even if a
    new τ was logged with it. Rows of a robot at rest are dropped too; their ticks are counted by
    the logged time.
    """
    if recording.dq is None:
        raise RecordingError(
            "the clock is rebuilt from dq, but there is none; leave clock_tick out"
        )
    fresh = np.concatenate([[True], np.any(np.diff(recording.q, axis=0) != 0.0, axis=1)])
    count = int(np.sum(~fresh))
    remaining = recording.take(
        fresh, f"Dropped {count} rows that repeat the positions before them."
    )
    if len(remaining) < 2:
        raise RecordingError(
            "the robot never moves, so its clock cannot be rebuilt; leave clock_tick out"
        )
    ticks = _ticks(remaining.t, remaining.q, recording.dq[fresh], tick, slow)
    t = remaining.t[0] + tick * np.concatenate([[0], np.cumsum(ticks)])
    duration, logged = float(t[-1] - t[0]), remaining.duration
    if abs(duration - logged) > MAX_DRIFT * logged:
        raise RecordingError(
            f"the clock rebuilt from dq runs {duration:.4g} s, but the log {logged:.4g} s; "
            "check the units of dq and t, and the tick"
        )
    return remaining.replace(t=t).noted(
        f"Rebuilt the clock in ticks of {tick:g} s from dq = v·dt: {duration:.6g} s "
        f"({logged:.6g} s by the log), {int(np.sum(ticks - 1))} ticks were skipped."
    )


def _ticks(
    t: FloatArray, q: FloatArray, dq: FloatArray, tick: float, slow: float
) -> NDArray[np.int64]:
    """Whole ticks (N−1,) between rows, at least one each."""
    v = 0.5 * (dq[1:] + dq[:-1])
    square = np.sum(v * v, axis=1)
    still = square <= slow * slow
    estimate = np.sum(v * np.diff(q, axis=0), axis=1) / np.where(still, 1.0, tick * square)
    ticks = np.maximum(np.round(estimate), 1.0).astype(np.int64)
    for first, last in runs(still):
        ends = np.round((t[first + 1 : last + 1] - t[first]) / tick).astype(np.int64)
        spent = 0
        for i, end in enumerate(ends, start=first):
            ticks[i] = max(int(end) - spent, 1)
            spent += int(ticks[i])
    return ticks
