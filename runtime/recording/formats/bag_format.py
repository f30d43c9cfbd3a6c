"""Log format bag: sensor_msgs/JointState in MCAP files, ROS 1 bags and ROS 2 bags.

JointState is in SI units by its definition (REP 103). In the recipe, `topic` is that of the
messages, `joints` picks and orders the joints by name, and `key` is a field of JointState.
"""

from collections.abc import Mapping
from typing import Any

from runtime.recording.formats import FOLDERS
from runtime.recording.formats.joint_states import FIELDS, JointLog, read_joint_states
from runtime.recording.formats.log_format import (
    Extras,
    LogFormat,
    LogReader,
    LogRows,
    RawFile,
    Texts,
)
from runtime.recording.formats.tables import LogTable
from runtime.recording.recipes.recipe import Recipe, Signal, Time

UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N*m"}
"""Field of JointState → unit."""


class BagReader(LogReader):
    """Reader of a bag; its messages are merged once."""

    def __init__(self, raw: RawFile) -> None:
        super().__init__(raw)
        self._merged: JointLog | None = None

    def convention(self) -> Recipe:
        """Recipe of the fields that the messages fill; the position is always expected."""
        log = self._messages()
        signals: dict[str, Any] = {
            "torque" if key == "effort" else key: Signal(unit=UNITS[key], layout="bag", key=key)
            for key in FIELDS
            if key in log.fields or key == "position"
        }
        return Recipe(time=Time(unit="s", layout="bag"), joints=log.names, **signals)

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Field of JointState that a part of the recipe means."""
        return self._messages().table(_field(kind, part), self.raw.name)

    def rows(self, parts: Mapping[str, Signal | Time]) -> LogRows:
        """Rows of merged messages."""
        keys = {kind: _field(kind, part) for kind, part in parts.items()}
        return self._messages().rows(keys, self.raw.name)

    def extras(self) -> Extras:
        """Names of the joints, once the messages are read."""
        return Extras() if self._merged is None else Extras({"joint_names": self._merged.names})

    def remarks(self) -> Texts:
        """Sentences about the messages, once they are read."""
        return () if self._merged is None else self._merged.remarks

    def _messages(self) -> JointLog:
        if self._merged is None:
            raw = self.raw
            self._merged = read_joint_states(
                raw.hashed(),
                raw.recipe.topic,
                raw.recipe.joints,
                () if raw.recipe.joints else raw.joints,
            )
        return self._merged


def _field(kind: str, part: Signal | Time) -> str:
    return part.key or {"time": "", "torque": "effort"}.get(kind, kind)


BAG = LogFormat(
    name="bag",
    sentence="messages of sensor_msgs/JointState in MCAP, a ROS 1 bag or a ROS 2 bag",
    suffixes=(".mcap", ".bag", ".db3"),
    reader=BagReader,
    marker=FOLDERS["bag"],
    is_one_file=True,
)
