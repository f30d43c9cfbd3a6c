"""JointState messages → one table: joints by name, messages by stamp.

Publishers of some of the joints each are merged where their stamps are equal. Messages that arrived
out of order are sorted; a field that no message fills is missing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.formats.bag_messages import messages
from runtime.recording.formats.merged_messages import FIELDS, Publisher, merged
from runtime.recording.formats.spool import Spool
from runtime.recording.formats.tables import MAX_CORRUPT, LogTable

MOST_JOINTS = 200
Topic = dict[tuple[str, ...], Publisher]


@dataclass(frozen=True, slots=True, eq=False)
class JointLog:
    """Joint states of a bag, merged; the numbers lie in a temporary file.

    Attributes:
        names: of the joints, in the order of the columns.
        fields: those of position, velocity and effort that the messages fill.
        count: number of rows.
        remarks: sentences.
    """

    names: tuple[str, ...]
    fields: tuple[str, ...]
    count: int
    remarks: tuple[str, ...]
    _spool: Spool

    def table(self, key: str, name: str) -> LogTable:
        """One field of the messages, or the time from the first message on.

        Returns (N, n) [s].
        """
        values = self.rows({"": key}, name).read(0, self.count)[""]
        return LogTable(values.copy(), np.arange(self.count, dtype=np.int64), self.remarks)

    def rows(self, kinds: Mapping[str, str], name: str) -> "MessageRows":
        """Rows of several fields."""
        for key in kinds.values():
            if key and key not in self.fields:
                raise RecordingError(
                    f"{name} is expected to hold the {key} of the joints, but its messages hold "
                    f"{', '.join(self.fields)} of JointState; leave it out of the recipe"
                )
        n = len(self.names)
        ends = {key: 1 + n * (k + 1) for k, key in enumerate(FIELDS)}
        places = {
            kind: slice(ends[key] - n, ends[key]) if key else slice(0, 1)
            for kind, key in kinds.items()
        }
        return MessageRows(self._spool, 1 + n * len(FIELDS), places, self.count)


@dataclass(frozen=True, slots=True)
class MessageRows:
    """Merged messages as rows of numbers.

    Attributes:
        spool: t and all fields, row by row.
        width: of a row.
        places: kind → its columns.
        count: number of rows.
    """

    spool: Spool
    width: int
    places: dict[str, slice]
    count: int

    def read(self, start: int, stop: int) -> dict[str, NDArray[np.float64]]:
        """Rows start … stop of every kind of signal."""
        rows = self.spool.read(start * self.width, (stop - start) * self.width)
        table = rows.reshape(-1, self.width)
        return {kind: table[:, place] for kind, place in self.places.items()}


def read_joint_states(path: Path, topic: str, wanted: tuple[str, ...]) -> JointLog:
    """Merged joint states of one topic of a bag, by default of all joints it names."""
    notes: list[str] = []
    topics: dict[str, Topic] = {}
    spool = Spool(path.name)
    for message in messages(path, notes):
        if topic and message.topic != topic:
            topics.setdefault(message.topic, {})
            continue
        publishers = topics.setdefault(message.topic, {})
        if message.names not in publishers:
            publishers[message.names] = Publisher(message.names, spool)
        publishers[message.names].add(message)
    chosen = _topic(path.name, topic, topics, wanted)
    publishers = topics[chosen]
    names = wanted or tuple(dict.fromkeys(name for group in publishers for name in group))
    if len(names) > MOST_JOINTS:
        raise RecordingError(
            f"{path.name} names {len(names)} joints; name those of the robot in a recipe: "
            "joints = [...]"
        )
    if len(topics) > 1:
        notes.append(f"Joint states were taken from the topic {chosen}.")
    whole = [p for group, p in publishers.items() if set(names) <= set(group)]
    parts = whole or [p for group, p in publishers.items() if set(names) & set(group)]
    return _merged(path.name, parts, names, tuple(notes))


def _topic(
    name: str,
    topic: str,
    topics: dict[str, Topic],
    wanted: tuple[str, ...],
) -> str:
    """The requested topic, or the only one with the joints."""
    if not topics or (topic and not topics.get(topic)):
        expected = f"the topic {topic!r}" if topic else "JointState"
        raise RecordingError(
            f"{name} holds no message of {expected}"
            + (f", but of {', '.join(sorted(topics))}" if topics else "")
            + "; choose one with topic = ... in a recipe, or record again"
        )
    if topic:
        return topic
    present = {each: {name for group in topics[each] for name in group} for each in topics}
    able = [each for each, names in present.items() if set(wanted) <= names]
    if not able:
        known = sorted(set.union(*present.values()))
        missing = [name for name in wanted if name not in known]
        raise RecordingError(
            f"{name} is expected to hold the joints {', '.join(wanted)}, but "
            f"{', '.join(missing or wanted)} are not among {', '.join(known[:20])}; name "
            "those of the log, in the order of the robot, in a recipe: joints = [...]"
        )
    if len(able) > 1:
        counts = {t: sum(p.count for p in topics[t].values()) for t in sorted(able)}
        listed = ", ".join(f"{t} ({count} messages)" for t, count in counts.items())
        raise RecordingError(
            f"{name} holds the joints in several topics, {listed}; choose one in a recipe: "
            f'topic = "{able[0]}"'
        )
    return able[0]


def _merged(
    name: str, parts: Sequence[Publisher], names: tuple[str, ...], notes: tuple[str, ...]
) -> JointLog:
    """All messages on one clock, sorted; rows that lack a joint are dropped and counted."""
    by_stamp = sum(p.count for p in parts) < 2 or any(p.stamps.moves for p in parts)
    if not by_stamp:
        notes += ("The stamps of the messages do not change; the instants of logging are used.",)
    late = sum((p.stamps if by_stamp else p.logged).late for p in parts)
    if late:
        notes += (f"Sorted {late} messages that came out of order.",)
    spool, start, count, total = Spool(name), 0, 0, 0
    filled = np.zeros(len(FIELDS), dtype=bool)
    for ticks, values in merged(parts, names, by_stamp):
        total += len(ticks)
        whole = np.isfinite(values[:, : len(names)]).all(axis=1) | (len(parts) == 1)
        if not whole.any():
            continue
        start = start if count else int(ticks[whole][0])
        rows = values[whole]
        spool.append(np.column_stack([(ticks[whole] - start) * 1e-9, rows]))
        filled |= np.isfinite(rows).reshape(len(rows), len(FIELDS), -1).any(axis=(0, 2))
        count += len(rows)
    if count < (1.0 - MAX_CORRUPT) * total:
        raise RecordingError(
            f"the messages of {name} hold some of the joints each, and only {count} of "
            f"{total} stamps have all of {', '.join(names)}; name joints of one "
            "publisher in a recipe, or record a topic with all of them"
        )
    if len(parts) > 1:
        dropped = f", {total - count} incomplete rows dropped" * (count < total)
        notes += (f"Merged {len(parts)} kinds of messages by name and stamp{dropped}.",)
    notes += (f"Joints {', '.join(names)}; time from the first message, {start / 1e9:.9f} s.",)
    fields = tuple(key for key, is_filled in zip(FIELDS, filled, strict=True) if is_filled)
    return JointLog(names, fields, count, notes, spool)
