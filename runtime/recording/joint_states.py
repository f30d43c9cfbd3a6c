"""JointState messages → one table per signal: joints by name, messages by stamp.

Publishers that tell some joints each are merged where their stamps agree. Messages that arrived
out of order are sorted; a field that no message fills is missing.
"""

from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.messages import Message, messages
from runtime.recording.tables import MAX_CORRUPT, Table

FIELDS = ("position", "velocity", "effort")
MOST_JOINTS = 200


@dataclass(frozen=True, slots=True, eq=False)
class JointLog:
    """What a bag says about some joints.

    Attributes:
        names: of the joints, in the order of the columns.
        fields: position, velocity, effort as far as they were told, (N, n).
        t: (N,) s from the first message on.
        remarks: sentences.
    """

    names: tuple[str, ...]
    fields: dict[str, NDArray[np.float64]]
    t: NDArray[np.float64]
    remarks: tuple[str, ...]

    def table(self, key: str, name: str) -> Table:
        """One field, or the time for the key "".

        Raises:
            RecordingError: there is no such field.
        """
        lines = np.arange(len(self.t), dtype=np.int64)
        if not key:
            return Table(self.t[:, None], lines, self.remarks)
        if key not in self.fields:
            raise RecordingError(
                f"{name} is expected to tell the {key} of the joints, but its messages hold "
                f"{', '.join(self.fields)} of JointState; leave it out of the recipe"
            )
        return Table(self.fields[key], lines, self.remarks)


@dataclass(slots=True)
class _Publisher:
    """All messages of one topic that name the same joints in the same order."""

    names: tuple[str, ...]
    stamps: array = field(default_factory=lambda: array("q"))
    logged: array = field(default_factory=lambda: array("q"))
    values: tuple[array, ...] = field(default_factory=lambda: tuple(array("d") for _ in FIELDS))

    def add(self, message: Message) -> None:
        self.stamps.append(message.stamp)
        self.logged.append(message.logged)
        blank = [np.nan] * len(self.names)
        for values, told in zip(self.values, message[4:], strict=True):
            whole = told if len(told) == len(self.names) else blank
            values.frombytes(np.asarray(whole, dtype=np.float64).tobytes())

    def matrix(self, index: int) -> NDArray[np.float64]:
        return np.frombuffer(self.values[index], dtype=np.float64).reshape(-1, len(self.names))


def read_joint_states(path: Path, topic: str, wanted: tuple[str, ...]) -> JointLog:
    """The joints asked for, all that the messages name by default, from one topic of a bag.

    Args:
        path: file or folder of the bag.
        topic: its name; needed only where several topics tell these joints.
        wanted: names of joints, in the order that is wanted.

    Raises:
        RecordingError: which topic is meant is not clear, or joints are missing.
    """
    notes: list[str] = []
    topics: dict[str, dict[tuple[str, ...], _Publisher]] = {}
    for message in messages(path, notes):
        if topic and message.topic != topic:
            topics.setdefault(message.topic, {})
            continue
        publishers = topics.setdefault(message.topic, {})
        publishers.setdefault(message.names, _Publisher(message.names)).add(message)
    chosen = _topic(path.name, topic, topics, wanted)
    publishers = topics[chosen]
    names = wanted or tuple(dict.fromkeys(name for told in publishers for name in told))
    if len(names) > MOST_JOINTS:
        raise RecordingError(
            f"{path.name} names {len(names)} joints; name those of the robot in a recipe: "
            "joints = [...]"
        )
    if len(topics) > 1:
        notes.append(f"Joint states were taken from the topic {chosen}.")
    whole = [p for told, p in publishers.items() if set(names) <= set(told)]
    parts = whole or [p for told, p in publishers.items() if set(names) & set(told)]
    return _merged(path.name, parts, names, tuple(notes))


def _topic(
    name: str,
    topic: str,
    topics: dict[str, dict[tuple[str, ...], _Publisher]],
    wanted: tuple[str, ...],
) -> str:
    """The topic asked for, or the only one that tells the joints."""
    if not topics or (topic and not topics.get(topic)):
        told = f"the topic {topic!r}" if topic else "JointState"
        raise RecordingError(
            f"{name} holds no message of {told}"
            + (f", but of {', '.join(sorted(topics))}" if topics else "")
            + "; choose one with topic = ... in a recipe, or record again"
        )
    if topic:
        return topic
    found = {each: {name for told in topics[each] for name in told} for each in topics}
    able = [each for each, names in found.items() if set(wanted) <= names]
    if not able:
        known = sorted(set.union(*found.values()))
        missing = [name for name in wanted if name not in known]
        raise RecordingError(
            f"{name} is expected to tell the joints {', '.join(wanted)}, but "
            f"{', '.join(missing or wanted)} cannot be found among {', '.join(known[:20])}; name "
            "those of the log, in the order of the robot, in a recipe: joints = [...]"
        )
    if len(able) > 1:
        counts = {t: sum(len(p.stamps) for p in topics[t].values()) for t in sorted(able)}
        listed = ", ".join(f"{t} ({count} messages)" for t, count in counts.items())
        raise RecordingError(
            f"{name} tells the joints in several topics, {listed}; choose one in a recipe: "
            f'topic = "{able[0]}"'
        )
    return able[0]


def _merged(
    name: str, parts: list[_Publisher], names: tuple[str, ...], notes: tuple[str, ...]
) -> JointLog:
    """All messages on one clock, sorted; rows that not every joint has are dropped and told."""
    clocks = [np.frombuffer(p.stamps, dtype=np.int64) for p in parts]
    total = sum(map(len, clocks))
    if total > 1 and all((clock == clock[0]).all() for clock in clocks):
        clocks = [np.frombuffer(p.logged, dtype=np.int64) for p in parts]
        notes += ("The stamps of the messages stand still; the instants of logging are used.",)
    late = sum(int(np.sum(np.diff(clock) < 0)) for clock in clocks)
    if late:
        notes += (f"Sorted {late} messages that came out of order.",)
    if len(parts) == 1:
        order = np.argsort(clocks[0], kind="stable")
        columns = [parts[0].names.index(each) for each in names]
        ticks = clocks[0][order]
        filled = [parts[0].matrix(i)[order][:, columns] for i in range(len(FIELDS))]
    else:
        ticks = np.unique(np.concatenate(clocks))
        filled = [np.full((len(ticks), len(names)), np.nan) for _ in FIELDS]
        for part, clock in zip(parts, clocks, strict=True):
            rows = np.searchsorted(ticks, clock)
            for j in (j for j, each in enumerate(names) if each in part.names):
                for i, values in enumerate(filled):
                    values[rows, j] = part.matrix(i)[:, part.names.index(names[j])]
        complete = np.isfinite(filled[0]).all(axis=1)
        if complete.sum() < (1.0 - MAX_CORRUPT) * len(ticks):
            raise RecordingError(
                f"the messages of {name} tell some joints each, and only {int(complete.sum())} of "
                f"{len(ticks)} stamps have all of {', '.join(names)}; name joints of one "
                "publisher in a recipe, or record a topic with all of them"
            )
        ticks, filled = ticks[complete], [values[complete] for values in filled]
        dropped = f", {int((~complete).sum())} incomplete rows dropped" * (not complete.all())
        notes += (f"Merged {len(parts)} kinds of messages by name and stamp{dropped}.",)
    told = dict(zip(FIELDS, filled, strict=True))
    fields = {key: values for key, values in told.items() if np.isfinite(values).any()}
    start = int(ticks[0])
    notes += (f"Joints {', '.join(names)}; time from the first message, {start / 1e9:.9f} s.",)
    t = np.asarray((ticks - start) * 1e-9, dtype=np.float64)
    return JointLog(names, fields, t, notes)
