"""The default convention: what a CSV or NPZ without a recipe must look like, as a recipe.

CSV      header  t, q1 … qn [, dq1 … dqn] [, ddq1 … ddqn] [, tau1 … taun]   in SI units
NPZ      arrays  t (N,), q (N, n) [, dq] [, ddq] [, tau]                    in SI units
Parquet  columns as in a CSV, or as in an NPZ with lists of n numbers
bag      sensor_msgs/JointState, in SI units by its definition (REP 103)

A CSV by libfranka's logToCSV has the header time, success_rate, state.q[0] …, time in ms.
"""

import re
from typing import Any

from runtime.errors import RecordingError
from runtime.recording.formats.joint_states import JointLog
from runtime.recording.formats.merged_messages import FIELDS
from runtime.recording.formats.tables import cells_of, find_header
from runtime.recording.recipes.recipe import Recipe, Signal, Time

UNITS = {"q": "rad", "dq": "rad/s", "ddq": "rad/s^2", "tau": "N*m"}
MESSAGE_UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N*m"}
FRANKA = {"q": "position", "dq": "velocity", "tau_J": "torque"}
KINDS = {"q": "position", "dq": "velocity", "ddq": "acceleration", "tau": "torque"}


def csv_convention(text: str, name: str) -> Recipe:
    """The recipe that a header by the convention stands for.

    Raises:
        RecordingError: no header, or joints that are not numbered 1 … n alike in every signal.
    """
    lines = text.splitlines()
    if (franka := _franka_convention(lines)) is not None:
        return franka
    return _columns_convention(cells_of(lines[find_header(lines, ("q1",), name)])[0], "csv", name)


def parquet_convention(titles: tuple[str, ...], name: str) -> Recipe:
    """The recipe that the columns of a Parquet file by the convention stand for.

    Raises:
        RecordingError: there is neither q nor q1.
    """
    if "q" in titles:
        keys = {key: key for key in UNITS if key in titles}
        signals: dict[str, Any] = {
            KINDS[key]: Signal(unit=UNITS[key], layout="parquet", key=key) for key in keys
        }
        return Recipe(time=Time(column="t", unit="s", layout="parquet"), **signals)
    if "q1" not in titles:
        raise RecordingError(
            f"{name} is expected to have the columns t, q1 … qn (or t and q with lists), but has "
            f"{', '.join(titles[:8]) or 'none'}; rename them or describe them in a recipe"
        )
    return _columns_convention(list(titles), "parquet", name)


def bag_convention(log: JointLog) -> Recipe:
    """The recipe that the fields of JointState stand for; the position is always asked for."""
    signals: dict[str, Any] = {
        "torque" if key == "effort" else key: Signal(unit=MESSAGE_UNITS[key], layout="bag", key=key)
        for key in FIELDS
        if key in log.fields or key == "position"
    }
    return Recipe(time=Time(unit="s", layout="bag"), joints=log.names, **signals)


def _franka_convention(lines: list[str]) -> Recipe | None:
    """The recipe of what logToCSV writes, where a header is such a one."""
    for line in lines[:50]:
        titles = cells_of(line)[0]
        prefix = next((p for p in ("state.", "") if f"{p}q[0]" in titles), None)
        if prefix is None or "time" not in titles:
            continue
        signals: dict[str, Any] = {}
        for key, kind in FRANKA.items():
            columns = [f"{prefix}{key}[{i}]" for i in range(len(titles))]
            found = tuple(column for column in columns if column in titles)
            if found:
                unit = {"q": "rad", "dq": "rad/s", "tau_J": "N*m"}[key]
                signals[kind] = Signal(unit=unit, layout="csv", columns=found)
        return Recipe(time=Time(column="time", unit="ms", layout="csv"), **signals)
    return None


def _columns_convention(titles: list[str], layout: str, name: str) -> Recipe:
    matches = [re.fullmatch(r"(q|dq|ddq|tau)([0-9]{1,4})", title) for title in titles]
    found: dict[str, list[int]] = {key: [] for key in KINDS}
    for match in matches:
        if match:
            found[match[1]].append(int(match[2]))
    n = max(found["q"])
    signals: dict[str, Any] = {}
    for key, joints in found.items():
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
        signals[KINDS[key]] = Signal(unit=UNITS[key], layout=layout, columns=columns)
    return Recipe(time=Time(column="t", unit="s", layout=layout), **signals)


def npz_convention(keys: tuple[str, ...]) -> Recipe:
    """The recipe that the arrays of an NPZ by the convention stand for; q is always asked for."""
    signals: dict[str, Any] = {
        KINDS[key]: Signal(unit=UNITS[key], layout="npz", key=key)
        for key in UNITS
        if key in keys or key == "q"
    }
    return Recipe(time=Time(key="t", unit="s", layout="npz"), **signals)
