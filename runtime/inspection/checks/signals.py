"""Checks of single signals, and of the velocities against the positions.

Saturation, end stops, rest, constant or little torque; order and signs of dq, jumps of one turn. dq
is compared with the derivative of q by their correlation, which needs no unit, so that this check
comes before those of the units. Velocities may be computed from the positions by a low-pass,

    dq_k = a dq_{k−1} + b (q_k − q_{k−1})/h_k,    b = 1 − a,    lag a h/(1 − a)

A measured velocity has noise of its own, which its past and the last step of q do not predict. The
filter delays dq, friction and Coriolis torque against q and τ; without the column, dq is
differentiated from q with the filter of the other signals.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

from runtime.estimators.regression.posterior import least_squares
from runtime.inspection.finding import ERROR, INFO, WARNING, Checked, Finding, joint_list, numbers
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording
from runtime.recording.consistency import unsigned_sentence, unwrap
from runtime.recording.preprocessing.segments import runs
from runtime.recording.rest_speeds import (
    STILL,
    as_rest_speed,
    rest_speeds,
    shown_rest_speed,
    still_travels,
)

FLAT_ROWS = 5  # equal extreme values in a row, while the joint moves, that make a flat top
FLAT_SHARE = 0.002  # share of the rows in flat tops above which a torque counts as cut off
NEAR_LIMIT = 0.98  # peak torque over the limit of effort from which on the joint is named
AT_END = 5e-4  # distance from the end of a range [rad or m] within which a joint stands at its stop
STOP_SHARE = 0.01  # share of the rows at a stop above which it is reported
MOVING_ROWS = 20  # rows of a moving joint that a torque must vary over
REST_SHARE, MOSTLY = 0.05, 0.9  # share of resting rows above which rest is reported
LITTLE = 0.1  # RMS torque over that of the most loaded joint below which a percentage misleads


def saturation(recording: Recording, lib: Library) -> list[Finding]:
    """Torques cut off in runs of `FLAT_ROWS`, peaks near the effort, positions at an end stop."""
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
    """Joints whose travel in the whole log is that of noise, below `still_travels`."""
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
    """Torques that keep one value while their joint moves, which friction alone changes."""
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
    """Share of rows in which no joint moves: friction is undetermined, the sign of dq noise."""
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
    """Joints whose RMS torque is so small beside the largest that an error in percent misleads."""
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


ALIKE = 0.8  # correlation of dq with the derivative of q above which the two belong together
TRAVEL = 0.05  # travel [rad or m] from which on a joint has had a velocity
GAINED = 0.2  # correlation that another order gains; joint speeds of a motion are alike
EXACT = 0.1  # residual of the filter over that of dq's past, below which dq has q alone
SLOWEST, FASTEST = 0.999, 0.3  # range of a; a dq with less memory is hardly late
CLOSED = 0.05  # distance of the gain b/(1 − a) of a filter from 1
FEWEST_ROWS = 200  # rows that the regression needs


def velocity_pairs(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Order and sign of dq, by the correlation with the derivative of q."""
    if recording.dq is None or plan.velocity is None or len(recording) < 10:
        return plan, []
    slope = np.gradient(unwrap(recording.q)[0], recording.t, axis=0)
    alike = correlation(_smooth(slope), _smooth(recording.dq))  # (joint of q, column of dq)
    _, order = linear_sum_assignment(-np.abs(alike))
    n = len(order)
    present, best = np.abs(np.diag(alike)), np.abs(alike[np.arange(n), order])
    moved = [j for j in range(n) if order[j] != j and best[j] > ALIKE]
    findings, changes = [], plan.velocity
    if len(moved) > 1 and sorted(order[moved]) == moved and (best - present)[moved].mean() > GAINED:
        final = np.arange(n)
        final[moved] = order[moved]
        changes = changes.reordered(final)
        columns = ", ".join(str(k) for k in changes.order)
        sentence = (
            f"the velocities belong to other joints: the derivative of q matches the columns "
            f"{columns} of dq (correlation {best[moved].min():.2f}, in the present order "
            f"{present[moved].max():.2f} at most); set order = [{columns}] under [velocity]"
        )
        evidence = {"order": list(map(int, changes.order)), "correlation": numbers(best)}
        findings.append(Finding("velocity_order", WARNING, sentence, evidence))
        alike = alike[:, final]
    else:
        final = np.arange(n)
    against = [j for j in range(n) if alike[j, j] < -ALIKE]
    if against:
        changes = changes.signed([-1.0 if j in against else 1.0 for j in range(n)])
        sentence = (
            f"dq is opposite to the derivative of q at {joint_list(lib.joint_names, against)} "
            f"(correlation {min(alike[j, j] for j in against):.2f}): one of the two has the "
            "wrong sign; set sign under [velocity], or under [position] where q is reversed"
        )
        facts = {"joints": against, "correlation": numbers(np.diag(alike))}
        findings.append(Finding("velocity_sign", WARNING, sentence, facts))
    return plan.replace(velocity=changes), findings


def constant_velocity(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Velocities that are constant while q moves; all are computed from q then, but for a law."""
    if recording.dq is None:
        return plan, []
    travel = np.ptp(unwrap(recording.q)[0], axis=0)
    dead = np.flatnonzero((np.ptp(recording.dq, axis=0) == 0.0) & (travel > TRAVEL)).tolist()
    if not dead:
        return plan, []
    names = joint_list(lib.joint_names, dead)
    computed = plan if plan.law else plan.replace(velocity=None)
    sentence = (
        f"dq of {names} keeps one value while q moves by {max(travel[dead]):.3g} rad or m: "
        "this velocity is not measured, and friction and rotor inertia of the joint are wrong; "
        "log it, leave [velocity] out of the recipe so that all velocities are computed from "
        "q, or lock the joint in the build"
    )
    evidence = {"joints": dead, "travel": numbers(travel[dead])}
    return computed, [Finding("velocity_constant", WARNING, sentence, evidence)]


def wraps(recording: Recording) -> list[Finding]:
    """Jumps of one turn that the reader has unwrapped."""
    sentences = [sentence for sentence in recording.history if sentence.startswith("Unwrapped")]
    check = "as the reader always does; check that the robot itself did not make these turns"
    return [Finding("wrap", INFO, f"{each[:-1]}, {check}") for each in sentences]


def correlation(a: Array, b: Array) -> Array:
    """Pearson's correlation (m, k) of each column of a (N, m) with each column of b (N, k)."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    size = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)
    return np.asarray(a.T @ b / np.where(size > 0, size, np.inf))


def _smooth(values: Array, width: int = 9) -> Array:
    """Moving mean over `width` rows, because differences over a short step are noisy."""
    if len(values) < 10 * width:
        return values
    sums = np.cumsum(values, axis=0)
    return np.asarray(sums[width:] - sums[:-width]) / width


def velocity_filter(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Velocities that are a first-order filter of the differences of q, by least squares."""
    if recording.dq is None or plan.velocity is None or len(recording) < FEWEST_ROWS or plan.law:
        return plan, []
    q = unwrap(recording.q)[0]
    moving = np.flatnonzero(np.ptp(q, axis=0) > STILL)
    if not moving.size:
        return plan, []
    steps = np.diff(recording.t)
    slope = np.diff(q, axis=0) / steps[:, None]
    fits = np.array([_filter(recording.dq[:, j], slope[:, j]) for j in moving])
    memory, gain, rest = fits.T
    if not ((rest < EXACT) & (memory > FASTEST) & (memory < SLOWEST)).all():
        return plan, []
    if (np.abs(gain - 1) > CLOSED).any():
        return plan, []
    factor, step = float(np.median(memory)), float(np.median(steps))
    lag = factor * step / (1 - factor)
    names = joint_list(lib.joint_names, [int(j) for j in moving])
    sentence = (
        f"dq of {names} is not a measurement: dq[k] = {factor:.3g} dq[k-1] + {1 - factor:.3g} "
        f"(q[k] - q[k-1])/h reproduces it, a low-pass of the positions that is {1e3 * lag:.0f} "
        "ms late; the velocity is computed from q instead: leave [velocity] out of the recipe"
    )
    evidence = {
        "factor": numbers(memory),
        "gain": numbers(gain),
        "unexplained": numbers(rest),
        "lag_s": lag,
    }
    return plan.replace(velocity=None), [Finding("velocity_filtered", WARNING, sentence, evidence)]


def _filter(dq: Array, slope: Array) -> tuple[float, float, float]:
    """a, b/(1 − a), and the residual over that of two past values of dq."""
    target = dq[2:]
    fitted = np.column_stack([dq[1:-1], slope[1:]])
    past = np.column_stack([dq[1:-1], dq[:-2]])
    (a, b), rest = least_squares(fitted, target)
    _, innovation = least_squares(past, target)
    left = float(np.linalg.norm(rest) / max(float(np.linalg.norm(innovation)), 1e-300))
    return float(a), float(b / (1 - a)) if a != 1 else np.inf, left
