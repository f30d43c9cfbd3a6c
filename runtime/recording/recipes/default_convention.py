"""The default convention of logs without a recipe: names and SI units of columns and arrays.

    t [s],  q1 … qn [rad],  dq1 … [rad/s],  ddq1 … [rad/s²],  tau1 … [N·m]

Each format has its own form of it (`runtime.recording.formats`).

A log with qd1 … instead of dq1 … is read without velocities, which are then differentiated from
positions. Where a signal is missing, what is not read but has the size of one is named, so that its
title can be corrected.
"""

import re
from collections.abc import Container, Iterable, Mapping
from typing import Any

from runtime.errors import RecordingError
from runtime.recording.recipes.recipe import SI, ControlLaw, Recipe, Signal, Time

KINDS = {"q": "position", "dq": "velocity", "ddq": "acceleration", "tau": "torque"}
"""Name of a signal → kind in a recipe."""


def columns_convention(titles: list[str], layout: str, name: str) -> Recipe:
    """Recipe of a table with the columns t, q1 … qn [, dq1 …] [, ddq1 …] [, tau1 …]."""
    matches = [re.fullmatch(r"(q|dq|ddq|tau)([0-9]{1,4})", title) for title in titles]
    numbers: dict[str, list[int]] = {key: [] for key in KINDS}
    for match in matches:
        if match:
            numbers[match[1]].append(int(match[2]))
    n = max(numbers["q"])
    signals: dict[str, Any] = {}
    for key, joints in numbers.items():
        if not joints:
            continue
        missing = sorted(set(range(1, n + 1)) - set(joints)) or sorted(
            set(joints) - {*range(n + 1)}
        )
        if missing:
            raise RecordingError(
                f"{name} is expected to have {key}1 … {key}{n} like its q1 … q{n}, but "
                f"{key}{missing[0]} does not match; name one column per joint and signal"
            )
        columns = tuple(f"{key}{joint}" for joint in range(1, n + 1))
        signals[KINDS[key]] = Signal(unit=SI[KINDS[key]], layout=layout, columns=columns)
    return Recipe(time=Time(column="t", unit="s", layout=layout), **signals)


def arrays_convention(present: Container[str], layout: str, prefix: str = "") -> Recipe:
    """Recipe of the arrays t, q [, dq] [, ddq], and tau, or q_des, kp, kd of a PD law."""
    signals: dict[str, Any] = {
        kind: Signal(unit=SI[kind], layout=layout, key=prefix + key)
        for key, kind in KINDS.items()
        if prefix + key in present or key == "q"
    }
    law = None if "torque" in signals else _law_of(present, prefix)
    return Recipe(time=Time(key=f"{prefix}t", unit="s", layout=layout), law=law, **signals)


def _law_of(present: Container[str], prefix: str) -> ControlLaw | None:
    needed, optional = ("q_des", "kp", "kd"), ("dq_des", "tau_ff", "effort_limit")
    if not all(prefix + key in present for key in needed):
        return None
    names: dict[str, Any] = {
        key: prefix + key for key in (*needed, *optional) if prefix + key in present
    }
    return ControlLaw(law="pd", **names)


_NUMBERED = re.compile(r"(.*?)\[?([0-9]{1,4})\]?")  # title that ends with the number of a joint

_WANTED = ("dq", "tau")  # signals whose absence is stated; accelerations are rarely measured

_SHOWN = 6

_NOT_READ = "are not read; if they are such a signal"


def unread_columns(titles: Iterable[str], name: str) -> tuple[str, ...]:
    """Sentence on numbered columns, one per joint, that are not read."""
    groups: dict[str, dict[int, str]] = {}
    for title in titles:
        if match := _NUMBERED.fullmatch(title):
            groups.setdefault(match[1], {})[int(match[2])] = title
    size = len(groups.get("q", {}))
    unread = [
        title
        for stem, group in groups.items()
        if stem not in KINDS and sorted(group) in (list(range(size)), list(range(1, size + 1)))
        for title in group.values()
    ]
    return _sentence([key for key in _WANTED if key not in groups], "columns", unread, name)


def unread_arrays(
    shapes: Mapping[str, tuple[int, ...]], plan: Recipe, name: str
) -> tuple[str, ...]:
    """Sentence on arrays of the shape of q that are not read."""
    signals, law = plan.signals(), plan.of_law()
    time = () if plan.time is None else (plan.time,)
    taken = {part.key for part in (*signals.values(), *law.values(), *time)}
    # Of one joint (N,) and (N, 1) are the same.
    sizes = {key: shape if len(shape) > 1 else (*shape, 1) for key, shape in shapes.items()}
    size = sizes.get(signals["position"].key)
    unread = [key for key, each in sizes.items() if each == size and key not in taken]
    present = {"dq": "velocity" in signals, "tau": "torque" in signals or bool(law)}
    missing = [key for key in _WANTED if not present[key]]
    return _sentence(missing, "arrays", unread, name)


def states_unread(step: str) -> bool:
    """Whether a step of the history of a recording is such a sentence."""
    return _NOT_READ in step


def _sentence(missing: list[str], what: str, unread: list[str], name: str) -> tuple[str, ...]:
    if not missing or not unread:
        return ()
    more = f" and {len(unread) - _SHOWN} more" if len(unread) > _SHOWN else ""
    return (
        f"Warning: {name} has no {' and no '.join(missing)}, and its {what} "
        f"{', '.join(unread[:_SHOWN])}{more} {_NOT_READ}, rename them or "
        "describe them in a recipe.",
    )
