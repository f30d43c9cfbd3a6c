"""The default convention: what a CSV or NPZ without a recipe must look like, as a recipe.

CSV   header  t, q1 … qn [, dq1 … dqn] [, ddq1 … ddqn] [, tau1 … taun]   in SI units
NPZ   arrays  t (N,), q (N, n) [, dq] [, ddq] [, tau]                    in SI units
"""

import re
from typing import Any

from runtime.errors import RecordingError
from runtime.recording.recipe import Recipe, Signal, Time
from runtime.recording.tables import cells_of, find_header

UNITS = {"q": "rad", "dq": "rad/s", "ddq": "rad/s^2", "tau": "N*m"}
KINDS = {"q": "position", "dq": "velocity", "ddq": "acceleration", "tau": "torque"}


def csv_convention(text: str, name: str) -> Recipe:
    """The recipe that a header by the convention stands for.

    Raises:
        RecordingError: no header, or joints that are not numbered 1 … n alike in every signal.
    """
    lines = text.splitlines()
    titles = cells_of(lines[find_header(lines, ("q1",), name)])[0]
    matches = [re.fullmatch(r"(q|dq|ddq|tau)(\d+)", title) for title in titles]
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
        signals[KINDS[key]] = Signal(unit=UNITS[key], layout="csv", columns=columns)
    return Recipe(time=Time(column="t", unit="s", layout="csv"), **signals)


def npz_convention(keys: tuple[str, ...]) -> Recipe:
    """The recipe that the arrays of an NPZ by the convention stand for; q is always asked for."""
    signals: dict[str, Any] = {
        KINDS[key]: Signal(unit=UNITS[key], layout="npz", key=key)
        for key in UNITS
        if key in keys or key == "q"
    }
    return Recipe(time=Time(key="t", unit="s", layout="npz"), **signals)
