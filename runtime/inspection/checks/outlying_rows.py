"""Rows whose numbers cannot follow from those around them: bursts, spikes, shifted rows.

    d_k = |x_k − median(x_{k−2} … x_{k+2})|  >  max(20 · 95 % quantile of d, 2 % of the range of x)

A step, as of Coulomb friction, has d = 0; noise and slow motion stay below the quantile. Positions
have no steps: the same rule for their differences, with 2 % of the range of q, finds both ends of
every jump. Two jumps within `APART` rows enclose a burst; so do two of opposite sign further apart,
between which the positions are displaced. A torque beyond the limit of effort and beyond all others
of its joint is an outlier for as long as it lasts. Signals that keep their value while the arm
moves are those of a logger or a driver that stopped.
"""

import itertools

import numpy as np
from scipy.ndimage import median_filter

from runtime.inspection.finding import WARNING, Checked, Finding, joint_list
from runtime.library import Array, Library, Mask
from runtime.recording import Recipe, Recording
from runtime.recording.preprocessing.segments import holes, runs
from runtime.recording.rest_speeds import rest_speeds

WINDOW = 5  # rows of the median
QUANTILE, TIMES, RANGE = 0.95, 20.0, 0.02
"""Constants of the equation above. Corrupt rows are fewer than 5 % of a log; normal noise exceeds
its 95 % quantile by a factor of 3 in millions of rows."""
MOST_OUTLIERS = 0.05  # share of rows above which a signal is noisy rather than corrupt in places
APART = 10  # rows between two outliers that belong to different bursts
ALIKE = 0.5  # smaller over larger jump of a displacement: q moves on between them
FASTER = 2.0  # step across a gap over that at the largest speed of a log, above which it is a jump
BEYOND = 1.2  # torque over the limit of effort from which on it cannot be one of the drive
FEWEST_ROWS = 50  # rows below which no quantile is taken
MOST_SPANS = 200  # intervals that a recipe takes
_NAMES = {"q": "position", "dq": "velocity", "tau": "torque"}
FROZEN_S, FROZEN_ROWS = 0.25, 20  # shortest interval: a quantised signal repeats some values
MOST_FROZEN = 0.5  # share of the rows above which a signal was not logged at all
JUMP = 5.0
"""Step of q after the interval over the usual step of the moving arm, which shows that the arm did
not stand still."""
_SIGNALS = {"q": "positions", "dq": "velocities", "tau": "torques"}


def outlying_rows(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Outliers of positions, velocities and torques."""
    if len(recording) < FEWEST_ROWS:
        return plan, []
    signals = {key: getattr(recording, key) for key in _NAMES}
    gaps = np.concatenate([[False], holes(recording.t), [False]])
    # Rows beside a gap of the clock, across which the arm may have moved, (N, 1).
    beside = np.asarray(gaps[1:] | gaps[:-1])[:, None]
    marks = {
        key: _outliers(values) & ~beside for key, values in signals.items() if values is not None
    }
    marks["q"] |= _jumps(recording)
    if recording.tau is not None:
        marks["tau"] |= _beyond_effort(recording.tau, lib)
    marks = {key: mark for key, mark in marks.items() if mark.any()}
    if not marks:
        return plan, []
    rows = np.any([mark.any(axis=1) for mark in marks.values()], axis=0)
    if rows.mean() > MOST_OUTLIERS:
        return plan, []
    bursts = _bursts(rows)
    t = recording.t
    spans = tuple((float(t[a]), float(t[b - 1])) for a, b in bursts)
    few = len(spans) <= MOST_SPANS
    remedy = "leave_out of the proposed recipe leaves them out"
    if not few:
        remedy = f"these are {len(spans)} places, too many for a recipe; repair the logger"
    said = [_sentence(key, signals[key], mark, lib) for key, mark in marks.items()]
    listed = ", ".join(f"{a:.4g} s" if a == b else f"{a:.4g}–{b:.4g} s" for a, b in spans[:5])
    places = listed + (f" and {len(spans) - 5} more" if len(spans) > 5 else "")
    both = int(np.sum(np.sum([mark.any(axis=1) for mark in marks.values()], axis=0) > 1))
    at_once = f"; in {both} rows several signals jump at once: these rows are corrupt"
    shifted = f"{at_once} (shifted columns, lost bytes)" if both else ""
    evidence = {
        "rows": int(rows.sum()),
        "corrupt_rows": both,
        "spans_s": [list(span) for span in spans],
        "joints": {
            _NAMES[key]: [int(j) for j in np.flatnonzero(mark.any(axis=0))]
            for key, mark in marks.items()
        },
    }
    if few:
        plan = plan.replace(leave_out=tuple(sorted({*plan.leave_out, *spans})))
    sentence = (
        f"{int(rows.sum())} rows do not follow from those around them (at {places}): "
        f"{'; '.join(said)}{shifted}; {remedy}"
    )
    return plan, [Finding("outliers", WARNING, sentence, evidence)]


def _outliers(values: Array) -> Mask:
    """Whether each value is far from the median of its neighbours, (N, n)."""
    far = np.abs(values - median_filter(values, size=(WINDOW, 1), mode="nearest"))
    low, high = np.quantile(values, [0.01, 0.99], axis=0)
    # Rows at rest have no noise in many logs and would lower the quantile.
    moving = np.any(np.diff(values, axis=0, prepend=np.nan) != 0.0, axis=1)
    usual = np.quantile(far[moving], QUANTILE, axis=0) if moving.any() else np.zeros(len(low))
    return np.asarray(far > np.maximum(TIMES * usual, RANGE * (high - low) + 1e-300))


def _beyond_effort(tau: Array, lib: Library) -> Mask:
    """Torques beyond effort and all others of their joint, (N, n), whatever the unit."""
    low, high = np.quantile(tau, [MOST_OUTLIERS / 2, 1.0 - MOST_OUTLIERS / 2], axis=0)
    far = (tau > high + (high - low)) | (tau < low - (high - low))
    return np.asarray(far & (np.abs(tau) > BEYOND * lib.limits()["effort"]))


def _jumps(recording: Recording) -> Mask:
    """Rows between jumps of q that are followed by another one, (N, n)."""
    marks = np.zeros(recording.q.shape, dtype=bool)
    # Differences, not speeds: uneven stamps change these.
    steps = np.diff(recording.q, axis=0)
    low, high = np.quantile(recording.q, [0.01, 0.99], axis=0)
    odd = _outliers(steps)
    # Across a gap the arm moves on, at most as fast as elsewhere.
    gaps, times = holes(recording.t)[:, None], np.diff(recording.t)[:, None]
    fastest = np.max(np.abs(steps) / times, axis=0, where=~odd & ~gaps, initial=0.0)
    reach = np.where(gaps, FASTER * fastest * times, 0.0)
    jumps = odd & (np.abs(steps) > np.maximum(RANGE * (high - low), reach))
    for j in range(jumps.shape[1]):
        for a, b in itertools.pairwise(np.flatnonzero(jumps[:, j])):
            there, back = steps[a, j], steps[b, j]  # of one displacement, which returns
            smaller, larger = sorted([abs(there), abs(back)])
            returns = there * back < 0.0 and smaller >= ALIKE * larger
            if b - a <= APART or (b - a <= MOST_OUTLIERS * len(steps) and returns):
                marks[a + 1 : b + 1, j] = True
    return marks


def _bursts(rows: Mask) -> list[tuple[int, int]]:
    """First and one past the last row of every burst; long ones gain two rows at both ends."""
    places = np.flatnonzero(rows)
    groups = np.split(places, np.flatnonzero(np.diff(places) > APART) + 1)
    bursts = []
    for group in groups:
        pad = 2 if len(group) > 2 else 0
        bursts.append((max(int(group[0]) - pad, 0), min(int(group[-1]) + 1 + pad, len(rows))))
    return bursts


def _sentence(key: str, values: Array, mark: Mask, lib: Library) -> str:
    """Joints and size of the outliers of one signal."""
    joints = [int(j) for j in np.flatnonzero(mark.any(axis=0))]
    peaks = np.where(mark, np.abs(values), 0.0).max(axis=0)
    names = joint_list(lib.joint_names, joints)
    count = int(mark.any(axis=1).sum())
    over = float(np.max(peaks[joints] / lib.limits()["effort"][joints]))
    effort = f", {over:.2g} times the limit of effort" if key == "tau" and over > 1.0 else ""
    return f"{_NAMES[key]} of {names} in {count} rows, up to {peaks[joints].max():.3g}{effort}"


def frozen(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Intervals in which signals of all joints keep their value, though q or others move on."""
    if len(recording) < FROZEN_ROWS:
        return plan, []
    slowest = rest_speeds(lib)
    signals = {key: getattr(recording, key) for key in _SIGNALS}
    signals = {key: values for key, values in signals.items() if values is not None}
    same = {k: np.all(np.diff(values, axis=0) == 0.0, axis=1) for k, values in signals.items()}
    intervals: list[tuple[int, int, tuple[str, ...]]] = []
    for key, repeats in same.items():
        for first, end in runs(repeats):
            last = end + 1
            if end - first < max(FROZEN_ROWS, FROZEN_S * recording.rate_hz):
                continue
            keys = tuple(k for k in same if same[k][first : last - 1].all())
            if keys[0] == key and _moves(recording, first, last, keys, slowest):
                intervals.append((first, last, keys))
    rows = sum(last - first for first, last, _ in intervals)
    if not intervals or rows > MOST_FROZEN * len(recording):
        return plan, []
    t = recording.t
    spans = tuple((float(t[first]), float(t[last - 1])) for first, last, _ in intervals)
    listed = "; ".join(
        f"{'every signal' if len(keys) == len(signals) else ', '.join(_SIGNALS[k] for k in keys)} "
        f"from {t[first]:.4g} to {t[last - 1]:.4g} s"
        for first, last, keys in intervals[:4]
    )
    sentence = (
        f"signals keep their value to the last bit while the arm moves ({listed}): the logger "
        "or a driver stopped; leave_out of the proposed recipe leaves these rows out"
    )
    frozen_keys = [list(keys) for *_, keys in intervals]
    evidence = {"spans_s": [list(span) for span in spans], "signals": frozen_keys}
    changed = plan.replace(leave_out=tuple(sorted({*plan.leave_out, *spans})))
    return changed, [Finding("frozen", WARNING, sentence, evidence)]


def _moves(
    recording: Recording, first: int, last: int, keys: tuple[str, ...], slowest: Array
) -> bool:
    """Whether the arm moves in rows first … last − 1, in which these signals are constant."""
    q, dq = recording.q, recording.dq
    if dq is not None and float((np.abs(dq[first:last]) / slowest).max(axis=1).min()) > 1.0:
        return True
    if "q" not in keys:  # the positions move on
        return bool(np.any(np.ptp(q[first:last], axis=0) > slowest * FROZEN_S))
    steps = np.abs(np.diff(q, axis=0)).max(axis=1)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else np.inf
    return last < len(q) and float(steps[last - 1]) > JUMP * usual
