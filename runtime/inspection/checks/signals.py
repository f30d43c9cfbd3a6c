"""What single signals show: flat tops, ends of the range, rest, joints with little torque."""

import numpy as np

from runtime.inspection.finding import INFO, WARNING, Finding, joint_list
from runtime.library import Array, Library
from runtime.recording import Recipe, Recording

FLAT_ROWS = 5
"""Equal extreme values in a row, while the joint moves, that make a flat top."""
FLAT_SHARE = 0.002
NEAR_LIMIT = 0.98
AT_END = 5e-4
"""rad or m from the end of its range at which a joint stands at its stop."""
REST_SPEED = 0.02
REST_SHARE = 0.05
LITTLE = 0.1
"""Part of the loudest joint's torque below which percent say little."""


def saturation(recording: Recording, lib: Library) -> list[Finding]:
    """Flat tops of τ, and positions that stand at the ends of their range."""
    findings, names = [], lib.joint_names
    moving = _moving(recording)
    if recording.tau is not None:
        effort = lib.limits()["effort"]
        flat = [_flat_rows(column, moving) for column in recording.tau.T]
        close = np.abs(recording.tau).max(axis=0) >= NEAR_LIMIT * effort
        tops = [j for j in range(len(names)) if flat[j] > FLAT_SHARE * len(recording)]
        if tops:
            peaks = ", ".join(
                f"{np.abs(recording.tau[:, j]).max():.4g} of {effort[j]:.4g}" for j in tops
            )
            findings.append(
                Finding(
                    "saturation",
                    WARNING,
                    f"τ has flat tops at {joint_list(names, tops)} "
                    f"({', '.join(str(flat[j]) for j in tops)} rows at {peaks} N·m or N): it was "
                    "cut off by the drive or the logger, so those rows lie; move more gently or "
                    "leave these stretches out",
                    {"joints": tops, "rows": [flat[j] for j in tops]},
                )
            )
        elif close.any():
            where = [int(j) for j in np.flatnonzero(close)]
            findings.append(
                Finding(
                    "saturation",
                    INFO,
                    f"τ comes within 2 % of the limit of effort at {joint_list(names, where)}",
                    {"joints": where},
                )
            )
    limits = lib.limits()
    ends = np.minimum(np.abs(recording.q - limits["lower"]), np.abs(recording.q - limits["upper"]))
    held = np.mean(ends < AT_END, axis=0)
    stops = [int(j) for j in np.flatnonzero(held > 0.01)]
    if stops:
        findings.append(
            Finding(
                "at_stop",
                WARNING,
                f"{joint_list(names, stops)} stands at the end of its range for "
                f"{100 * held.max():.1f} % of the time: a stop carries torque that no model "
                "knows; leave these stretches out",
                {"joints": stops, "share": [float(held[j]) for j in stops]},
            )
        )
    return findings


def rest(recording: Recording, plan: Recipe) -> list[Finding]:
    """Phases in which nothing moves: sign(dq) is a coin there (trap 7)."""
    still = ~_moving(recording).any(axis=1)
    share, spans = float(still.mean()), rest_spans(recording)
    if share < REST_SHARE or not spans:
        return []
    given = plan.preparation.rest_speed
    told = ", ".join(f"{a:.3g}–{b:.3g} s" for a, b in spans[:4])
    more = f" and {len(spans) - 4} more" if len(spans) > 4 else ""
    what = (
        f"rest_speed = {given:g} of the recipe drops these rows"
        if given is not None
        else f"drop these rows with rest_speed = {REST_SPEED:g} under [preparation]"
    )
    return [
        Finding(
            "rest",
            INFO if given is not None else WARNING,
            f"the arm rests for {100 * share:.0f} % of the log ({told}{more}), where friction "
            f"may be anything between its bounds and the sign of dq is noise; {what}",
            {"share": share, "spans_s": [list(span) for span in spans]},
            trap=7,
        )
    ]


def rest_spans(recording: Recording, least_s: float = 0.3) -> list[tuple[float, float]]:
    """(from, to) [s] of rests of at least `least_s`."""
    still = ~_moving(recording).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    t = recording.t
    spans = [(float(t[a]), float(t[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in spans if b - a >= least_s]


def little_torque(recording: Recording, lib: Library) -> list[Finding]:
    """Joints whose percentage says nothing (trap 13)."""
    if recording.tau is None:
        return []
    rms = np.sqrt(np.mean(recording.tau**2, axis=0))
    few = [int(j) for j in np.flatnonzero(rms < LITTLE * rms.max())]
    if not few:
        return []
    told = ", ".join(f"{rms[j]:.3g}" for j in few)
    return [
        Finding(
            "little_torque",
            INFO,
            f"{joint_list(lib.joint_names, few)} carries little torque (RMS {told} N·m or N, the "
            f"loudest joint {rms.max():.3g}): judge it by its RMS error, not in percent",
            {"joints": few, "rms": [float(x) for x in rms]},
            trap=13,
        )
    ]


def _moving(recording: Recording) -> Array:
    """Which joints move, row by row, (N, n)."""
    if recording.dq is not None:
        return np.asarray(np.abs(recording.dq) >= REST_SPEED)
    # Over a tenth of a second, because the steps of an encoder are no speed.
    width = max(1, round(0.05 * recording.rate_hz))
    ahead = np.minimum(np.arange(len(recording)) + width, len(recording) - 1)
    behind = np.maximum(np.arange(len(recording)) - width, 0)
    span = np.maximum(recording.t[ahead] - recording.t[behind], 1e-12)
    speed = (recording.q[ahead] - recording.q[behind]) / span[:, None]
    return np.asarray(np.abs(speed) >= REST_SPEED)


def _flat_rows(values: Array, moving: Array) -> int:
    """Rows in runs of at least `FLAT_ROWS` equal values at either extreme while the arm moves."""
    total = 0
    busy = moving.any(axis=1)
    size = float(np.ptp(values))
    if size == 0.0:
        return 0
    for extreme in (values.max(), values.min()):
        top = (np.abs(values - extreme) <= 1e-9 * size) & busy
        edges = np.flatnonzero(np.diff(np.concatenate([[False], top, [False]]).astype(int)))
        lengths = edges[1::2] - edges[::2]
        total += int(lengths[lengths >= FLAT_ROWS].sum())
    return total
