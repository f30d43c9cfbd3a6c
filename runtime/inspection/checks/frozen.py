"""Signals that keep their value while the arm moves: a logger or a driver that stopped (trap 2)."""

import numpy as np
from numpy.typing import NDArray

from runtime.inspection.finding import WARNING, Finding
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.rest_speeds import rest_speeds

LEAST_S, LEAST_ROWS = 0.25, 20
"""Shortest interval that is reported: a quantised signal of a slow arm repeats some values."""
MOST = 0.5
"""Share of the rows above which a signal was not logged at all."""
JUMP = 5.0
"""Step of q after the interval over the usual step of the moving arm, which shows that the arm did
not stand still."""
_NAMES = {"q": "positions", "dq": "velocities", "tau": "torques"}


def frozen(recording: Recording, plan: Recipe, lib: Library) -> tuple[Recipe, list[Finding]]:
    """Intervals in which signals of all joints keep their value to the last bit, though the arm
    moves.

    Measured: the step of q after the interval, or the motion that the other signals show.
    """
    if len(recording) < LEAST_ROWS:
        return plan, []
    slowest = rest_speeds(lib)
    signals = {key: getattr(recording, key) for key in _NAMES}
    signals = {key: values for key, values in signals.items() if values is not None}
    same = {key: _repeats(values) for key, values in signals.items()}
    intervals: list[tuple[int, int, tuple[str, ...]]] = []
    for key, repeats in same.items():
        for first, last in _runs(repeats, recording.rate_hz):
            keys = tuple(k for k in same if same[k][first : last - 1].all())
            if keys[0] == key and _moves(recording, first, last, keys, slowest):
                intervals.append((first, last, keys))
    rows = sum(last - first for first, last, _ in intervals)
    if not intervals or rows > MOST * len(recording):
        return plan, []
    t = recording.t
    spans = tuple((float(t[first]), float(t[last - 1])) for first, last, _ in intervals)
    listed = "; ".join(
        f"{'every signal' if len(keys) == len(signals) else ', '.join(_NAMES[k] for k in keys)} "
        f"from {t[first]:.4g} to {t[last - 1]:.4g} s"
        for first, last, keys in intervals[:4]
    )
    return plan.replace(leave_out=tuple(sorted({*plan.leave_out, *spans}))), [
        Finding(
            "frozen",
            WARNING,
            f"signals keep their value to the last bit while the arm moves ({listed}): the logger "
            "or a driver stopped; leave_out of the proposed recipe leaves these rows out",
            {
                "spans_s": [list(span) for span in spans],
                "signals": [list(keys) for *_, keys in intervals],
            },
            trap=2,
        )
    ]


def _repeats(values: Array) -> NDArray[np.bool_]:
    """Whether all joints repeat the row before, (N − 1,)."""
    return np.asarray(np.all(np.diff(values, axis=0) == 0.0, axis=1))


def _runs(repeats: NDArray[np.bool_], rate_hz: float) -> list[tuple[int, int]]:
    """First and one past the last row of the long runs of equal rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], repeats, [False]]).astype(int)))
    least = max(LEAST_ROWS, LEAST_S * rate_hz)
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(int(a), int(b) + 1) for a, b in pairs if b - a >= least]


def _moves(
    recording: Recording, first: int, last: int, keys: tuple[str, ...], slowest: Array
) -> bool:
    """Whether the arm moves in rows first … last − 1, in which these signals are constant."""
    q, dq = recording.q, recording.dq
    if dq is not None and float((np.abs(dq[first:last]) / slowest).max(axis=1).min()) > 1.0:
        return True
    if "q" not in keys:  # the positions move on
        return bool(np.any(np.ptp(q[first:last], axis=0) > slowest * LEAST_S))
    steps = np.abs(np.diff(q, axis=0)).max(axis=1)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else np.inf
    return last < len(q) and float(steps[last - 1]) > JUMP * usual
