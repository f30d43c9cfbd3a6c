"""Signal, joint and unit from the title of a column or the name of a file.

`tau_J_3 [mA]` is a torque of joint 3 in mA; `q_d2` is a commanded position, not a measurement.
"""

import re
from dataclasses import dataclass

KINDS: dict[str, tuple[str, ...]] = {
    "acceleration": ("ddq", "qdd", "acc", "acceleration", "accelerations"),
    "velocity": ("dq", "qd", "vel", "velocity", "velocities", "speed", "omega"),
    "torque": (
        *("tau", "torque", "torques", "effort", "efforts", "moment", "current", "curr"),
        *("currents", "load"),
    ),
    "position": ("q", "pos", "position", "positions", "angle", "angles", "theta"),
    "time": ("t", "time", "times", "timestamp", "stamp", "clock"),
}
COMMANDED = {
    *("d", "des", "desired", "target", "cmd", "command", "commanded", "ref", "reference", "set"),
    *("setpoint", "goal", "gen", "model", "sim", "computed", "expected", "nominal"),
}
UNIT_WORDS: dict[str, dict[str, str]] = {
    "time": {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us", "ns": "ns"},
    "position": {"rad": "rad", "deg": "deg", "degree": "deg", "degrees": "deg", "mm": "mm"},
    "velocity": {"rad": "rad/s", "deg": "deg/s", "rpm": "rpm"},
    "acceleration": {"rad": "rad/s^2", "deg": "deg/s^2"},
    "torque": {"nm": "N*m", "mnm": "mN*m", "ma": "mA", "a": "A"},
}
SI = {
    "time": "s",
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s^2",
    "torque": "N*m",
}


@dataclass(frozen=True, slots=True)
class Meaning:
    """Signal, joint and unit that a name stands for.

    Attributes:
        kind: kind of signal; "" where the name has no known word.
        joint: number as written; −1 for none.
        is_measured: False where a word stands for a command or a model.
        unit: unit as written; "" for none.
    """

    kind: str
    joint: int
    is_measured: bool
    unit: str


def meaning(title: str) -> Meaning:
    """Read one title; its words are separated by case, digits and punctuation."""
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", title)
    words = [w for w in re.split(r"[^a-zA-Zµ]+", spaced.lower()) if w]
    digits = re.findall(r"\d+", title)
    kind = next((k for k, known in KINDS.items() if set(words) & set(known)), "")
    units = UNIT_WORDS.get(kind, {})
    bracket = re.search(r"[\[(]\s*([a-zA-Zµ.*]+)", title)
    candidates = [bracket[1].lower().replace(".", "").replace("*", "")] if bracket else words[1:]
    unit = next((units[word] for word in candidates if word in units), "")
    return Meaning(
        kind=kind,
        joint=int(digits[-1]) if digits else -1,
        is_measured=not (set(words) & COMMANDED),
        unit=unit,
    )


def by_joint(titles: list[str], names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Titles that contain the names of the joints, such as `arm_1_joint_effort`."""
    groups: dict[str, dict[str, str]] = {}
    longest_first = sorted(names, key=len, reverse=True)
    for title in titles:
        name = next((each for each in longest_first if each in title), None)
        if name is not None:
            groups.setdefault(title.replace(name, "#"), {})[name] = title
    return {
        stem: tuple(members[name] for name in names)
        for stem, members in groups.items()
        if len(members) == len(names)
    }
