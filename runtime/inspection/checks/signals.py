"""Checks of single signals: saturation, end stops, rest, constant or little torque."""

import numpy as np

from runtime.inspection.finding import ERROR, INFO, WARNING, Finding, joint_list
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import unsigned_sentence
from runtime.recording.preprocessing.segments import runs
from runtime.recording.rest_speeds import (
    as_rest_speed,
    rest_speeds,
    shown_rest_speed,
    still_travels,
)

FLAT_ROWS = 5
"""Equal extreme values in a row, while the joint moves, that make a flat top."""
FLAT_SHARE = 0.002
"""Share of the rows in flat tops above which a torque counts as cut off."""
NEAR_LIMIT = 0.98
"""Peak torque over the limit of effort from which on the joint is named."""
AT_END = 5e-4
"""Distance from the end of the range [rad or m] within which a joint stands at its stop."""
STOP_SHARE = 0.01
"""Share of the rows at a stop above which it is reported."""
MOVING_ROWS = 20
"""Rows of a moving joint that a torque must vary over."""
REST_SHARE, MOSTLY = 0.05, 0.9
"""Share of resting rows above which rest is reported."""
LITTLE = 0.1
"""RMS torque over that of the most loaded joint below which a percentage misleads."""


def saturation(recording: Recording, lib: Library) -> list[Finding]:
    """Torques cut off by the drive or logger, and positions at the ends of their range.

    Measured: rows in runs of `FLAT_ROWS` equal extreme torques while the arm moves; peak torque
    over the limit of effort; share of the rows within `AT_END` of the end of the range.
    """
    findings, names = [], lib.joint_names
    moving = moving_joints(recording, lib)
    if recording.tau is not None:
        effort = lib.limits()["effort"]
        flat = [_flat_rows(column, moving) for column in recording.tau.T]
        close = np.abs(recording.tau).max(axis=0) >= NEAR_LIMIT * effort
        tops = [j for j in range(len(names)) if flat[j] > FLAT_SHARE * len(recording)]
        if tops:
            peaks = ", ".join(
                f"{np.abs(recording.tau[:, j]).max():.4g} of {effort[j]:.4g}" for j in tops
            )
            sentence = (
                f"τ is constant at its peak for {joint_list(names, tops)} "
                f"({', '.join(str(flat[j]) for j in tops)} rows at {peaks} N·m or N): the "
                "drive or the logger has cut it off, so that these rows are wrong; record a "
                "slower motion, or leave these intervals out"
            )
            evidence = {"joints": tops, "rows": [flat[j] for j in tops]}
            findings.append(Finding("saturation", WARNING, sentence, evidence))
        elif close.any():
            where = [int(j) for j in np.flatnonzero(close)]
            sentence = f"τ reaches 98 % of the limit of effort at {joint_list(names, where)}"
            findings.append(Finding("saturation", INFO, sentence, {"joints": where}))
    limits = lib.limits()
    ends = np.minimum(np.abs(recording.q - limits["lower"]), np.abs(recording.q - limits["upper"]))
    at_end = np.mean(ends < AT_END, axis=0)
    stops = [int(j) for j in np.flatnonzero(at_end > STOP_SHARE)]
    if stops:
        sentence = (
            f"{joint_list(names, stops)} stands at the end of its range for "
            f"{100 * at_end.max():.1f} % of the time: the stop carries torque that the "
            "model does not contain; leave these intervals out"
        )
        facts = {"joints": stops, "share": [float(at_end[j]) for j in stops]}
        findings.append(Finding("at_stop", WARNING, sentence, facts))
    return findings


def still_joints(recording: Recording, lib: Library) -> list[Finding]:
    """Joints that do not move in the whole log.

    Measured: travel of every joint, below `still_travels` by noise and vibration alone.
    """
    still = np.flatnonzero(np.ptp(recording.q, axis=0) < still_travels(lib))
    if not still.size:
        return []
    sentence = (
        f"{', '.join(lib.joint_names[j] for j in still)} never moved ({len(still)} of "
        f"{lib.n_joints} joints): the log does not show what only their motion determines"
    )
    if still.size == lib.n_joints:
        sentence = "no joint moves: the log shows at most the gravity torque of one pose"
    sentence = f"{sentence}; record a motion that moves every joint"
    evidence = {"joints": still.tolist()}
    return [
        Finding(
            "still_joints", WARNING if 2 * still.size > lib.n_joints else INFO, sentence, evidence
        )
    ]


def constant_torque(recording: Recording, lib: Library) -> list[Finding]:
    """Torques that keep one value while their joint moves.

    Measured: range of τ over the rows in which the joint moves; friction alone changes it there.
    """
    if recording.tau is None or not recording.tau.any():
        return []
    moves = moving_joints(recording, lib)
    travels = np.ptp(recording.q, axis=0) > still_travels(lib)
    # Equal steps of a coarse signal last for some rows, not for all of a motion.
    where = [
        j
        for j in np.flatnonzero(travels).tolist()
        if moves[:, j].sum() >= MOVING_ROWS and np.ptp(recording.tau[moves[:, j], j]) == 0.0
    ]
    if not where:
        return []
    values = [float(recording.tau[moves[:, j], j][0]) for j in where]
    sentence = (
        f"the torque of {joint_list(lib.joint_names, where)} keeps one value "
        f"({', '.join(f'{value:.4g}' for value in values)}) while the joint moves: it was not "
        "logged; log it, or lock the joint when building the robot"
    )
    return [Finding("constant_torque", ERROR, sentence, {"joints": where, "values": values})]


def unsigned_torque(recording: Recording) -> list[Finding]:
    """Torques or currents that are never negative at any joint."""
    tau = recording.tau
    if tau is None or not (sentence := unsigned_sentence(recording)):
        return []
    joints = np.flatnonzero(np.ptp(tau, axis=0) > 0).tolist()
    evidence = {"joints": joints, "range": [float(tau.min()), float(tau.max())]}
    return [Finding("unsigned_torque", ERROR, sentence, evidence)]


def rest(recording: Recording, plan: Recipe, lib: Library) -> list[Finding]:
    """Intervals in which no joint moves.

    Measured: share of the rows in which every joint is slower than `rest_speeds`. There the
    friction torque lies anywhere between its bounds, and the sign of dq is noise.
    """
    still = ~moving_joints(recording, lib).any(axis=1)
    share, spans = float(still.mean()), rest_spans(recording, lib)
    if share < REST_SHARE or not spans or (np.ptp(recording.q, axis=0) < still_travels(lib)).all():
        return []
    given, usual = plan.preparation.rest_speed, shown_rest_speed(as_rest_speed(lib))
    listed = ", ".join(f"{a:.3g}–{b:.3g} s" for a, b in spans[:4])
    more = f" and {len(spans) - 4} more" if len(spans) > 4 else ""
    what = (
        f"rest_speed = {shown_rest_speed(given)} of the recipe drops these rows"
        if given is not None
        else f"drop these rows with rest_speed = {usual} under [preparation]"
        if share < MOSTLY
        else "few rows would be left without them: record a faster motion"
    )
    sentence = (
        f"the arm rests for {100 * share:.0f} % of the log ({listed}{more}); there friction "
        f"lies anywhere between its bounds and the sign of dq is noise; {what}"
    )
    evidence = {"share": share, "spans_s": [list(span) for span in spans]}
    return [Finding("rest", INFO if given is not None else WARNING, sentence, evidence)]


def rest_spans(
    recording: Recording, lib: Library, least_s: float = 0.3
) -> list[tuple[float, float]]:
    """Intervals of rest, (from, to) [s]."""
    still = ~moving_joints(recording, lib).any(axis=1)
    t = recording.t
    spans = [(float(t[a]), float(t[b - 1])) for a, b in runs(np.asarray(still))]
    return [(a, b) for a, b in spans if b - a >= least_s]


def little_torque(recording: Recording, lib: Library) -> list[Finding]:
    """Joints whose relative torque error misleads.

    Measured: RMS torque of every joint over that of the most loaded one.
    """
    if recording.tau is None:
        return []
    rms = np.sqrt(np.mean(recording.tau**2, axis=0))
    few = [int(j) for j in np.flatnonzero(rms < LITTLE * rms.max())]
    if not few:
        return []
    listed = ", ".join(f"{rms[j]:.3g}" for j in few)
    sentence = (
        f"the torque of {joint_list(lib.joint_names, few)} is small (RMS {listed} N·m or N, of "
        f"the most loaded joint {rms.max():.3g}): use the RMS error there, not the error in "
        "percent; a wrong gain there may not be reported"
    )
    evidence = {"joints": few, "rms": [float(x) for x in rms]}
    return [Finding("little_torque", INFO, sentence, evidence)]


def moving_joints(recording: Recording, lib: Library) -> Array:
    """Whether each joint is faster than its `rest_speeds`, row by row."""
    slowest = rest_speeds(lib)
    if recording.dq is not None:
        return np.asarray(np.abs(recording.dq) >= slowest)
    # Speed over a tenth of a second: single steps of an encoder look like speed.
    width = max(1, round(0.05 * recording.rate_hz))
    ahead = np.minimum(np.arange(len(recording)) + width, len(recording) - 1)
    behind = np.maximum(np.arange(len(recording)) - width, 0)
    span = np.maximum(recording.t[ahead] - recording.t[behind], 1e-12)
    speed = (recording.q[ahead] - recording.q[behind]) / span[:, None]
    return np.asarray(np.abs(speed) >= slowest)


def _flat_rows(values: Array, moving: Array) -> int:
    """Number of rows in runs of at least `FLAT_ROWS` equal extremes while the arm moves."""
    total = 0
    busy = moving.any(axis=1)
    size = float(np.ptp(values))
    if size == 0.0:
        return 0
    for extreme in (values.max(), values.min()):
        top = (np.abs(values - extreme) <= 1e-9 * size) & busy
        total += sum(b - a for a, b in runs(top) if b - a >= FLAT_ROWS)
    return total
