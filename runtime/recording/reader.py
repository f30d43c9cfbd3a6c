"""Files → `Recording`: units, signs, joint order and gear are settled at this door, once.

Corrupt rows are dropped, counted and told; whatever cannot be a recording is one sentence of
`RecordingError`. `recipe` says the order of the steps from a number in a file to a joint angle.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime import datasets
from runtime.errors import RecordingError
from runtime.recording.consistency import check_consistency, unwrap
from runtime.recording.files import Files, parts_of
from runtime.recording.recipe import UNITS, Recipe, Signal, Time
from runtime.recording.recipe_file import bundled_names, load_recipe
from runtime.recording.recording import FloatArray, Recording
from runtime.recording.tables import MAX_CORRUPT, Table

FIELDS = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "tau"}
HUGE = 1e9
HUGE_TIME = 1e20  # nanoseconds since 1970 are 2e18


def read_recording(
    path: str | Path, recipe: str | Path | Recipe | None = None, run: str | None = None
) -> Recording:
    """A recording from a file, a folder of raw files, or the name of a known data set.

    Without a recipe a CSV has the header `t,q1…qn` with optional `dq1…`, `ddq1…`, `tau1…`, and an
    NPZ the arrays `t, q, dq, ddq, tau` with one row per instant; both in SI units, joint side,
    τ with the sign of the inverse dynamics. A folder is read with the recipe given, else with its
    own recipe.toml, else with the bundled recipe of the folder's name.

    Args:
        path: CSV, NPZ, folder, or a name such as "panda_gaz".
        recipe: TOML file, name of a bundled recipe, or a `Recipe`.
        run: which run, where the recipe knows several.

    Raises:
        RecordingError: in one sentence what was expected, what came and what to do.
    """
    place = _locate(path)
    chosen = _choose_recipe(place, recipe)
    if chosen is not None and run is not None:
        chosen = chosen.replace(run=run)
    files = Files(place, chosen or Recipe())
    plan = files.plan()
    raw = {kind: files.table(part) for kind, part in parts_of(plan).items()}
    extras = files.extras()
    if (columns := files.columns()) is not None:
        raw["columns"] = columns
    keep, dropped = _usable_rows(raw)
    t, clock_notes = _time(plan.time, raw, keep)
    signals: dict[str, Any] = {}
    notes: list[str] = []
    for kind, signal in plan.signals().items():
        signals[FIELDS[kind]], told = _joint_side(kind, signal, raw[kind].values[keep], plan)
        notes += told
    if columns is not None:
        names = extras.get("column_names", ())
        signals["columns"] = columns.values[keep].reshape(len(t), -1, max(len(names), 1))
    t, signals, repeated = _without_repeats(t, signals)
    recording = Recording(
        t=t,
        **signals,
        column_names=extras.get("column_names", ()) if columns is not None else (),
        motors=files.motors() if columns is not None else None,
        name=extras.get("name", ("",))[0] or plan.name or place.stem,
        joint_names=plan.joints or extras.get("joint_names", ()),
        source=files.sha256,
        recipe=chosen,
    )
    rate = f" at {recording.rate_hz:.6g} Hz (median)" if len(recording) > 1 else ""
    size = f"{len(recording)} rows of {recording.n_joints} joints{rate}"
    remarks = dict.fromkeys(remark for table in raw.values() for remark in table.remarks)
    history = (*extras.get("history", ()), f"Read {size} from {', '.join(files.sha256)}.")
    history += (*remarks, *dropped, *clock_notes, *notes, *repeated, *files.pin_notes())
    return check_consistency(recording.replace(history=history))


def plan_of(
    path: str | Path, recipe: str | Path | Recipe | None = None, run: str | None = None
) -> Recipe:
    """The recipe that a log is read with, the default convention written out.

    Raises:
        RecordingError: there is no such log or recipe.
    """
    place = _locate(path)
    chosen = _choose_recipe(place, recipe) or Recipe()
    plan = Files(place, chosen if run is None else chosen.replace(run=run)).plan()
    return chosen.replace(time=plan.time, run=plan.run, **plan.signals())


def _locate(path: str | Path) -> Path:
    """The existing path, or the folder of the known data set of that name."""
    if Path(path).exists():
        return Path(path)
    if str(path) in bundled_names():
        return datasets.locate(str(path))
    raise RecordingError(
        f"there is no file or folder {str(path)!r}; give a path, "
        f"or one of the known data sets {', '.join(bundled_names())}"
    )


def _choose_recipe(place: Path, recipe: str | Path | Recipe | None) -> Recipe | None:
    """The recipe asked for; a folder also has its own recipe.toml, or the bundled one."""
    if recipe is not None:
        return load_recipe(recipe)
    if not place.is_dir():
        return None
    if (place / "recipe.toml").is_file():
        return load_recipe(place / "recipe.toml")
    if place.resolve().name in bundled_names():
        return load_recipe(place.resolve().name)
    raise RecordingError(
        f"the folder {place.name} has no recipe, so nobody knows what its files mean; write "
        f"{place.name}/recipe.toml with [time], [position] and [torque] (file, columns, unit), "
        "after the example of the bundled recipes"
    )


def _usable_rows(raw: dict[str, Table]) -> tuple[NDArray[np.int64], list[str]]:
    """The rows that are whole in every table, and what is said about the others."""
    counts = {kind: len(table.values) for kind, table in raw.items()}
    most, rows = max(counts.values()), min(counts.values())
    good = np.zeros(most, dtype=bool)
    good[:rows] = True
    for kind, table in raw.items():
        limit = HUGE_TIME if kind == "time" else HUGE
        good[:rows] &= (np.abs(table.values[:rows]) < limit).all(axis=1)  # False for NaN
    bad = int(most - good.sum())
    told = ", ".join(f"{kind} {count}" for kind, count in counts.items())
    if rows < (1.0 - MAX_CORRUPT) * most:
        raise RecordingError(
            f"expected as many rows of every signal, but there are {told}; "
            "check the files, the width, and that samples are rows"
        )
    lines = next(iter(raw.values())).lines
    places = [str(lines[i]) for i in np.flatnonzero(~good) if i < len(lines)]
    where = ", ".join(places[:5]) + (f" and {len(places) - 5} more" if len(places) > 5 else "")
    if bad > MAX_CORRUPT * most:
        raise RecordingError(
            f"expected rows of numbers, but {bad} of {most} rows are corrupt (cut short, no "
            f"number, NaN or beyond 1e9; lines {where}); export the log again"
        )
    if not bad:
        return np.flatnonzero(good), []
    where = where or "the end"
    return np.flatnonzero(good), [
        f"Dropped {bad} of {most} rows as corrupt (cut short, no number, NaN or beyond 1e9): "
        f"lines {where}."
    ]


def _time(
    plan: Time | None, raw: dict[str, Table], keep: NDArray[np.int64]
) -> tuple[FloatArray, list[str]]:
    """Seconds of the usable rows; a constant rate counts the dropped rows too."""
    if plan is None or plan.rate_hz is not None:
        rate = plan.rate_hz if plan is not None and plan.rate_hz is not None else 1.0
        return keep / rate, [f"Time was made from a constant rate of {rate:g} Hz."]
    t = raw["time"].values[keep]
    if t.shape[1] != 1:
        raise RecordingError(f"expected one column of time, got {t.shape[1]}; correct the recipe")
    t = t[:, 0]
    if plan.from_zero:
        note = [f"Time is counted from the first sample, {t[0]:.9g} {plan.unit}."]
        return (t - t[0]) * UNITS["time"][plan.unit], note
    return t * UNITS["time"][plan.unit], []


def _joint_side(
    kind: str, signal: Signal, raw: FloatArray, plan: Recipe
) -> tuple[FloatArray, list[str]]:
    """x_i = sign·gain·unit·raw[:, order_i], then q = R⁻¹x + offset, dq = R⁻¹x, τ = Rᵀx."""
    n = raw.shape[1]
    order = np.array(signal.order or range(n))
    if len(order) != n:
        raise RecordingError(
            f"[{kind}] order names {len(order)} joints, but the file has {n}; name every joint"
        )
    units = (signal.unit,) if isinstance(signal.unit, str) else signal.unit
    unit = _per_joint(kind, "unit", [UNITS[kind][each] for each in units], n)
    factor = unit * _per_joint(kind, "sign", signal.sign, n)
    if signal.gain is not None:
        factor = factor * _per_joint(kind, "gain", signal.gain, n)
    x = raw[:, order] * factor
    notes = []
    if kind == "position":
        angular = np.array(
            [each in {"rad", "deg"} for each in units] * (n if len(units) == 1 else 1)
        )
        unwrapped, jumps = unwrap(x)
        x = np.where(angular, unwrapped, x)
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
    x = x + _per_joint(kind, "offset", signal.offset, n) * unit
    steps = {
        f"from {'/'.join(dict.fromkeys(units))}": not bool(np.all(unit == 1.0)),
        "with a gain": signal.gain is not None,
        "reordered": bool(np.any(order != np.arange(n))),
        "with changed signs": bool(np.any(np.asarray(signal.sign) < 0)),
        "through the gear matrix": bool(plan.gear),
        "plus an offset": bool(np.any(np.asarray(signal.offset))),
    }
    done = [step for step, applies in steps.items() if applies]
    return x, [*notes, f"Converted {kind}: {', '.join(done)}."] if done else notes


def _per_joint(kind: str, key: str, value: object, n: int) -> FloatArray:
    """A scalar or a list as n numbers."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if len(numbers) not in {1, n}:
        raise RecordingError(
            f"[{kind}] {key} expects one value or {n}, got {len(numbers)}; give one per joint"
        )
    return np.broadcast_to(numbers, (n,))


def _without_repeats(
    t: FloatArray, signals: dict[str, Any]
) -> tuple[FloatArray, dict[str, Any], list[str]]:
    """Leaves out rows written twice: the same stamp and the same values as the row before."""
    same = np.diff(t) == 0.0
    for values in signals.values():
        axes = tuple(range(1, values.ndim))
        same &= np.all(np.diff(values, axis=0) == 0.0, axis=axes)
    if not same.any():
        return t, signals, []
    keep = np.concatenate([[True], ~same])
    note = f"Dropped {int(same.sum())} rows that were written twice, stamp and values."
    return t[keep], {key: values[keep] for key, values in signals.items()}, [note]
