"""The default convention of logs without a recipe: names and SI units of columns and arrays.

    t [s],  q1 … qn [rad],  dq1 … [rad/s],  ddq1 … [rad/s²],  tau1 … [N·m]

Each format has its own form of it (`runtime.recording.formats`).
"""

import re
from collections.abc import Container
from typing import Any

from runtime.errors import RecordingError
from runtime.recording.recipes.control_law import ControlLaw
from runtime.recording.recipes.recipe import Recipe, Signal, Time

UNITS = {"q": "rad", "dq": "rad/s", "ddq": "rad/s^2", "tau": "N*m"}
"""Name of a signal → unit."""
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
        signals[KINDS[key]] = Signal(unit=UNITS[key], layout=layout, columns=columns)
    return Recipe(time=Time(column="t", unit="s", layout=layout), **signals)


def arrays_convention(present: Container[str], layout: str, prefix: str = "") -> Recipe:
    """Recipe of a file with the arrays t, q [, dq] [, ddq] [, tau]; q is always expected.

    Without tau, the arrays q_des, kp and kd [, dq_des] [, tau_ff] [, effort_limit] give the torque
    of a PD law.
    """
    signals: dict[str, Any] = {
        KINDS[key]: Signal(unit=UNITS[key], layout=layout, key=prefix + key)
        for key in UNITS
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
