"""Tables of a log → SI units, joint side: corrupt rows, units, signs, order, gear, repeats.

The order of the steps from a number in a file to a joint angle is that of `recipe`. Where a control
law gives the torque, desired and measured motion on the joint side give it:

    τ = r clip(kp r (q_des − q) + kd r (dq_des − dq) + τ_ff, ± limit)

It is commanded: what the motors deliver may be later (`Preparation.torque_delay_s`) and is not
known from the log. Source of the law: the drives of servo arms and legged robots.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from runtime.common.tables import significant
from runtime.errors import RecordingError
from runtime.library import Array, Integers
from runtime.recording.consistency import unwrap
from runtime.recording.current_gains import CurrentGains
from runtime.recording.formats.tables import MAX_CORRUPT, Tables
from runtime.recording.recipes.recipe import EXTRA_UNITS, UNITS, ControlLaw, Recipe, Signal, Time
from runtime.recording.recording import Recording

FIELDS = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "tau"}
_AS_MEASURED = {"desired_position": "position", "desired_velocity": "velocity"}
HUGE = 1e9
HUGE_TIME = 1e20  # nanoseconds since 1970 are 2e18
INSTANT = 1e-7  # rounding of instants [s], those of 1970 included


def converted(
    plan: Recipe,
    raw: Tables,
    first_row: int = 0,
    origin: float | None = None,
    history: tuple[str, ...] = (),
    **facts: Any,
) -> Recording:
    """The usable rows of all tables in SI units and on the joint side, as the recipe states.

    facts: further fields of the recording.
    """
    keep, dropped = usable_rows(raw)
    t, notes = _time(plan.time, raw, keep, first_row, origin)
    signals: dict[str, Any] = {}
    steps: list[str] = []
    for kind, signal in plan.signals().items():
        rows = _kept(raw[kind].values, keep)
        signals[FIELDS[kind]], done = _joint_side(kind, signal, rows, plan)
        steps += done
    if plan.law is not None:
        parts = {}
        for kind, signal in plan.of_law().items():
            rows = _kept(raw[kind].values, keep)
            if kind in _AS_MEASURED:
                rows, _ = _joint_side(_AS_MEASURED[kind], signal, rows, plan)
            parts[kind] = rows
        signals["tau"], sentence = commanded_torque(plan.law, signals, parts)
        steps.append(sentence)
    for name, signal in plan.extra.items():
        rows = _kept(raw[f"extra.{name}"].values, keep)
        signals[f"extra.{name}"] = _extra(name, signal, rows, signals["q"].shape[1])
    if "columns" in raw:
        width = max(len(facts["column_names"]), 1)
        signals["columns"] = raw["columns"].values[keep].reshape(len(t), -1, width)
    t, signals, repeated = _without_repeats(t, signals)
    t, signals, omitted = _without_intervals(t, signals, plan.leave_out)
    signals["signals"] = {name: signals.pop(f"extra.{name}") for name in plan.extra}
    facts |= {"torque_source": plan.torque_source, "law": plan.law}
    said = (*history, *dropped, *notes, *steps, *repeated, *omitted)
    return Recording(t, **signals, **facts, history=said)


def commanded_torque(
    law: ControlLaw, motion: Mapping[str, Array], parts: Mapping[str, Array]
) -> tuple[Array, str]:
    """Torque of a control law: motion (N, n) [rad, m], parts (N, n) → (N, n) [N·m, N]."""
    q = motion["q"]
    n = q.shape[1]
    for kind, values in parts.items():
        if values.shape != q.shape:
            raise RecordingError(
                f"[torque] {kind.replace('_', ' ')} is expected to have {n} columns like the "
                f"positions, got {values.shape[1]}; name one per joint"
            )
    kp, kd, limit, gear = (
        parts[key] if key in parts else per_joint("torque", key, getattr(law, key), n)
        for key in ("kp", "kd", "effort_limit", "gear")
    )
    tau = kp * gear * (parts["desired_position"] - q)
    if "dq" in motion and law.needs_velocity:
        tau += kd * gear * (parts.get("desired_velocity", 0.0) - motion["dq"])
    tau += parts.get("feed_forward", 0.0)
    bound = np.where(limit > 0, limit, np.inf)
    clipped = float(np.mean(np.any(np.abs(tau) > bound, axis=1)))
    percent = significant(100 * clipped)
    limits = f"; {percent} % of the rows are at the effort limit" if clipped else ""
    torque = gear * np.clip(tau, -bound, bound)
    return torque, f"Computed τ by the {law}: it is commanded, not measured{limits}."


def per_joint(kind: str, key: str, value: object, n: int) -> Array:
    """One value per joint (n,) from a scalar or a list."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if len(numbers) not in {1, n}:
        raise RecordingError(
            f"[{kind}] {key} expects one value or {n}, got {len(numbers)}; give one per joint"
        )
    return np.broadcast_to(numbers, (n,))


def usable_rows(raw: Tables) -> tuple[Integers, list[str]]:
    """Rows that are whole in every table, and sentences about the others."""
    counts = {kind: len(table.values) for kind, table in raw.items()}
    most, rows = max(counts.values()), min(counts.values())
    good = np.zeros(most, dtype=bool)
    good[:rows] = True
    for kind, table in raw.items():
        limit, values = HUGE_TIME if kind == "time" else HUGE, table.values[:rows]
        # One pass over the rows: no number is larger than the norm of all, and NaN is not less.
        flat = values.ravel(order="K")  # as it lies in memory, without a copy
        with np.errstate(over="ignore", invalid="ignore"):
            square = np.dot(flat, flat)
        if not (values.size and square < limit**2):
            good[:rows] &= (np.abs(values) < limit).all(axis=1)
    bad = int(most - good.sum())
    counted = ", ".join(f"{kind} {count}" for kind, count in counts.items())
    if rows < (1.0 - MAX_CORRUPT) * most:
        raise RecordingError(
            f"expected as many rows of every signal, but there are {counted}; "
            "check the files, the width, and that samples are rows"
        )
    lines = next(iter(raw.values())).lines
    places = [str(lines[i]) for i in np.flatnonzero(~good) if i < len(lines)]
    where = ", ".join(places[:5]) + (f" and {len(places) - 5} more" if len(places) > 5 else "")
    if bad > MAX_CORRUPT * most:
        raise RecordingError(
            f"expected rows of numbers, but {bad} of {most} rows are corrupt (cut short, not "
            f"numbers, NaN or beyond 1e9; lines {where}); export the log again"
        )
    if not bad:
        return np.flatnonzero(good), []
    where = where or "the end"
    return np.flatnonzero(good), [
        f"Dropped {bad} of {most} rows as corrupt (cut short, not numbers, NaN or beyond 1e9): "
        f"lines {where}."
    ]


def _kept(values: Array, keep: Integers) -> Array:
    """The usable rows, without a copy where all are usable."""
    return values if len(keep) == len(values) else values[keep]


def _time(
    plan: Time | None, raw: Tables, keep: Integers, first_row: int, origin: float | None
) -> tuple[Array, list[str]]:
    """Seconds of the usable rows; a constant rate counts the dropped rows too."""
    if plan is None or plan.rate_hz is not None:
        rate = plan.rate_hz if plan is not None and plan.rate_hz is not None else 1.0
        return (first_row + keep) / rate, [f"Time was made from a constant rate of {rate:g} Hz."]
    t = _kept(raw["time"].values, keep)
    if t.shape[1] != 1:
        raise RecordingError(f"expected one column of time, got {t.shape[1]}; correct the recipe")
    t = t[:, 0]
    if not t.size:
        raise RecordingError("the log is expected to hold samples, got none; record again")
    if plan.from_zero:
        start = float(t[0]) if origin is None else origin
        note = [f"Time is counted from the first sample, {start:.9g} {plan.unit}."]
        return (t - start) * UNITS["time"][plan.unit], note
    return t * UNITS["time"][plan.unit], []


def _joint_side(kind: str, signal: Signal, raw: Array, plan: Recipe) -> tuple[Array, list[str]]:
    """x_i = sign·gain·unit·raw[:, order_i], then q = R⁻¹x + offset, dq = R⁻¹x, τ = Rᵀx."""
    n = raw.shape[1]
    order = np.array(signal.order or range(n))
    if len(order) != n:
        raise RecordingError(
            f"[{kind}] order names {len(order)} joints, but the file has {n}; name every joint"
        )
    units = signal.units
    unit = per_joint(kind, "unit", [UNITS[kind][each] for each in units], n)
    factor = unit * per_joint(kind, "sign", signal.sign, n)
    if signal.gain is not None:
        factor = factor * per_joint(kind, "gain", signal.gain, n)
    as_is = np.array_equal(order, np.arange(n)) and np.all(factor == 1.0)
    x = raw if as_is else raw[:, order] * factor
    notes = []
    if kind == "position":
        kinds = [each in {"rad", "deg"} for each in units] * (n if len(units) == 1 else 1)
        angular = np.array(kinds)
        unwrapped, jumps = unwrap(x)
        x = unwrapped if angular.all() else np.where(angular, unwrapped, x)
        joints = ", ".join(str(j + 1) for j in np.flatnonzero(jumps * angular))
        if joints:
            count = int(jumps[angular].sum())
            notes.append(f"Unwrapped {count} jumps of one turn in q at joints {joints}.")
    if plan.gear:
        R = np.array(plan.gear)
        if R.shape != (n, n):
            raise RecordingError(
                f"[gear] matrix is {R.shape[0]} × {R.shape[1]}, but {kind} has {n} joints; "
                "give one row per joint"
            )
        x = x @ R if kind == "torque" else np.linalg.solve(R, x.T).T
    offset = per_joint(kind, "offset", signal.offset, n)
    if offset.any():
        x = x + offset * unit
    steps = {
        f"from {'/'.join(dict.fromkeys(units))}": not bool(np.all(unit == 1.0)),
        "with a gain": signal.gain is not None,
        "reordered": bool(np.any(order != np.arange(n))),
        "with changed signs": bool(np.any(np.asarray(signal.sign) < 0)),
        "through the gear matrix": bool(plan.gear),
        "plus an offset": bool(offset.any()),
    }
    done = [step for step, applies in steps.items() if applies]
    return x, [*notes, f"Converted {kind}: {', '.join(done)}."] if done else notes


def _extra(name: str, signal: Signal, raw: Array, n: int) -> Array:
    """A further signal (N, n) of the joints, or of the robot as a whole in one column."""
    kind, width = f"extra.{name}", raw.shape[1]
    if width not in {1, n}:
        raise RecordingError(
            f"[{kind}] expects one column or {n}, got {width}; name one per joint or one for the "
            "robot"
        )
    unit = per_joint(kind, "unit", [EXTRA_UNITS[each] for each in signal.units], width)
    gain = 1.0 if signal.gain is None else per_joint(kind, "gain", signal.gain, width)
    sign, offset = (per_joint(kind, key, getattr(signal, key), width) for key in ("sign", "offset"))
    values = (raw[:, list(signal.order or range(width))] * sign * gain + offset) * unit
    return np.broadcast_to(values, (len(raw), n))


def _without_repeats(t: Array, signals: dict[str, Any]) -> tuple[Array, dict[str, Any], list[str]]:
    """Drop rows with the same stamp and the same values as the row before."""
    same = np.diff(t) == 0.0
    if not same.any():
        return t, signals, []
    for values in signals.values():
        same &= np.all(np.diff(values, axis=0) == 0.0, axis=tuple(range(1, values.ndim)))
    if not same.any():
        return t, signals, []
    keep = np.concatenate([[True], ~same])
    note = f"Dropped {int(same.sum())} rows that were written twice, stamp and values."
    return t[keep], {key: values[keep] for key, values in signals.items()}, [note]


def _without_intervals(
    t: Array, signals: dict[str, Any], intervals: tuple[tuple[float, float], ...]
) -> tuple[Array, dict[str, Any], list[str]]:
    """Leave out the rows of some intervals [s], both ends included."""
    keep = np.ones(len(t), dtype=bool)
    for first, last in intervals:
        keep &= (t < first - INSTANT) | (t > last + INSTANT)
    if keep.all():
        return t, signals, []
    if not keep.any():
        raise RecordingError(
            "leave_out of the recipe leaves no row; shorten its intervals, which are in s of the "
            f"recording's clock ({t[0]:.6g} to {t[-1]:.6g} s)"
        )
    note = f"Left out {int(np.sum(~keep))} rows in the intervals of the recipe."
    return t[keep], {key: values[keep] for key, values in signals.items()}, [note]


def scaled(recording: Recording, gains: CurrentGains) -> Recording:
    """The recording with torques τ = Rᵀ diag(k) R⁻ᵀ i of estimated gains k, R the gear matrix."""
    if not recording.has_unknown_gains:
        return recording
    tau, k = recording.required("tau"), gains.gain
    R = np.array(recording.recipe.gear if recording.recipe else ())
    coupled = np.count_nonzero(R) > np.count_nonzero(np.diagonal(R)) if R.size else False
    tau = ((tau @ np.linalg.inv(R)) * k) @ R if coupled else tau * k
    listed = ", ".join(f"{each:.4g}" for each in k)
    sentence = f"Multiplied currents by estimated gains ({listed} N·m/A or N/A; {gains.scale})."
    return recording.replace(tau=tau, gains=gains).noted(sentence)
