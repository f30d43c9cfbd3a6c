"""Log format bag: sensor_msgs/JointState in MCAP files, ROS 1 bags and ROS 2 bags.

JointState is in SI units by its definition (REP 103). In the recipe, `topic` is that of the
messages, `joints` picks and orders the joints by name, and `key` is a field of JointState.
Publishers of some of the joints each are merged where their stamps are equal.

    publisher   a row per message: stamp, instant of logging, position, velocity, effort
    merged      t and the three fields of the requested joints, sorted, one row per stamp

Neither is held in memory: the numbers lie in temporary files. A row is yielded only when no earlier
row can follow, so that late messages are sorted in.
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array, Integers
from runtime.recording.coupled_joints import renamed_joints
from runtime.recording.formats import FOLDERS
from runtime.recording.formats.bag_messages import Message, messages
from runtime.recording.formats.log_format import Extras, LogFormat, LogReader, LogRows, Texts
from runtime.recording.formats.tables import MAX_CORRUPT, LogTable, Spool, SpooledRows
from runtime.recording.recipes.recipe import Recipe, Signal, Time

FIELDS = ("position", "velocity", "effort")

PIECE = 2**15
"""Messages of a publisher that are written to the spool together."""

Ticks = Integers


@dataclass(slots=True)
class Clock:
    """One of the two clocks of a publisher: whether it changes, and how often it runs backwards."""

    first: int = -1
    last: int = -1
    moves: bool = False
    late: int = 0

    def tick(self, stamp: int) -> None:
        """Take the next instant [ns]."""
        if self.first < 0:
            self.first = stamp
        self.moves |= stamp != self.first
        self.late += stamp < self.last
        self.last = stamp


@dataclass(slots=True)
class Publisher:
    """All messages of one topic that name the same joints in the same order."""

    names: tuple[str, ...]  # of the joints
    spool: Spool  # temporary file of the rows
    stamps: Clock = field(default_factory=Clock)  # stamps, logged: its two clocks
    logged: Clock = field(default_factory=Clock)
    count: int = 0  # number of messages
    _places: list[tuple[int, int, int, int]] = field(default_factory=list)
    _ticks: array = field(default_factory=lambda: array("q"))
    _values: array = field(default_factory=lambda: array("d"))

    def add(self, message: Message) -> None:
        """Add a message; a field of another length than the names is missing."""
        self.stamps.tick(message.stamp)
        self.logged.tick(message.logged)
        self._ticks.extend((message.stamp, message.logged))
        blank = [np.nan] * len(self.names)
        for values in (message.position, message.velocity, message.effort):
            whole = values if len(values) == len(self.names) else blank
            self._values.frombytes(np.asarray(whole, dtype=np.float64).tobytes())
        self.count += 1
        if len(self._ticks) == 2 * PIECE:
            self._write()

    def in_order(self, by_stamp: bool) -> Iterator[tuple[Ticks, Array]]:
        """Yield pieces of ticks (k,) [ns] and fields (k, 3 n), sorted by one of the clocks."""
        self._write()
        ticks, values = np.zeros(0, dtype=np.int64), np.zeros((0, 3 * len(self.names)))
        earliest = [place[2 if by_stamp else 3] for place in self._places]
        for k, (start, count, *_) in enumerate(self._places):
            numbers = self.spool.read(start, count * (2 + values.shape[1]))
            stamps, rows = numbers[: 2 * count].view(np.int64), numbers[2 * count :]
            ticks = np.concatenate([ticks, stamps[(0 if by_stamp else 1) :: 2]])
            values = np.concatenate([values, rows.reshape(count, -1)])
            order = np.argsort(ticks, kind="stable")
            ticks, values = ticks[order], values[order]
            still = min(earliest[k + 1 :], default=int(ticks[-1]))
            ready = int(np.searchsorted(ticks, still, side="right"))
            if ready:
                yield ticks[:ready], values[:ready]
            ticks, values = ticks[ready:], values[ready:]

    def _write(self) -> None:
        ticks = np.frombuffer(self._ticks, dtype=np.int64).reshape(-1, 2)
        if not ticks.size:
            return
        rows = np.frombuffer(self._values, dtype=np.float64).reshape(len(ticks), -1)
        start = self.spool.append(ticks.view(np.float64))
        self.spool.append(rows)
        by_stamp, by_log = ticks.min(axis=0).tolist()
        self._places.append((start, len(rows), by_stamp, by_log))
        self._ticks, self._values = array("q"), array("d")


def merged(
    publishers: Sequence[Publisher], names: tuple[str, ...], by_stamp: bool
) -> Iterator[tuple[Ticks, Array]]:
    """Yield pieces of ticks [ns] and fields of some joints; NaN where no message has a value."""
    if len(publishers) == 1:
        columns = _columns(publishers[0].names, names)[1]
        for ticks, values in publishers[0].in_order(by_stamp):
            yield ticks, values[:, columns]
        return
    more = {k: each.in_order(by_stamp) for k, each in enumerate(publishers)}
    held: dict[int, tuple[Ticks, Array]] = {}
    reached = dict.fromkeys(more, -1)
    while more:
        k = min(more, key=reached.__getitem__)  # the publisher that is furthest behind continues
        piece = next(more[k], None)
        if piece is None:
            del more[k]
        else:
            reached[k] = int(piece[0][-1])
            if k in held:
                ticks, values = (np.concatenate(pair) for pair in zip(held[k], piece, strict=True))
                piece = ticks, values
            held[k] = piece
        until = min((reached[k] for k in more), default=None)
        now, later = [], {}
        for k, (ticks, values) in held.items():
            cut = len(ticks) if until is None else int(np.searchsorted(ticks, until))
            if cut:
                now.append((publishers[k].names, ticks[:cut], values[:cut]))
            if cut < len(ticks):
                later[k] = ticks[cut:], values[cut:]
        held = later
        if now:
            yield _filled(now, names)


def _filled(
    parts: list[tuple[tuple[str, ...], Ticks, Array]], names: tuple[str, ...]
) -> tuple[Ticks, Array]:
    """Join the rows of one stamp."""
    ticks = np.unique(np.concatenate([stamps for _, stamps, _ in parts]))
    filled = np.full((len(ticks), len(FIELDS) * len(names)), np.nan)
    for present, stamps, values in parts:
        places, columns = _columns(present, names)
        filled[np.searchsorted(ticks, stamps)[:, None], places] = values[:, columns]
    return ticks, filled


def _columns(present: tuple[str, ...], names: tuple[str, ...]) -> tuple[list[int], list[int]]:
    """Columns of the present joints among the requested ones, and among the present ones."""
    shared = [(j, present.index(name)) for j, name in enumerate(names) if name in present]
    fields = range(len(FIELDS))
    places = [f * len(names) + j for f in fields for j, _ in shared]
    return places, [f * len(present) + i for f in fields for _, i in shared]


MOST_JOINTS = 200
Topic = dict[tuple[str, ...], Publisher]


@dataclass(frozen=True, slots=True, eq=False)
class JointLog:
    """Joint states of a bag, merged; the numbers lie in a temporary file."""

    names: tuple[str, ...]  # of the joints, in the order of the columns
    fields: tuple[str, ...]  # those of position, velocity and effort that the messages fill
    count: int  # number of rows
    remarks: tuple[str, ...]  # sentences
    _spool: Spool

    def table(self, key: str, name: str) -> LogTable:
        """One field of the messages, or the time from the first message on, (N, n) [s]."""
        values = self.rows({"": key}, name).read(0, self.count)[""]
        return LogTable(values.copy(), np.arange(self.count, dtype=np.int64), self.remarks)

    def rows(self, kinds: Mapping[str, str], name: str) -> SpooledRows:
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
        return SpooledRows(self._spool, 1 + n * len(FIELDS), places)


def read_joint_states(
    path: Path, topic: str, wanted: tuple[str, ...], robot: tuple[str, ...] = ()
) -> JointLog:
    """Merged joint states of one topic; wanted: names of the log, robot: those of the robot."""
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
    if not wanted and robot:
        listed = {name for groups in topics.values() for group in groups for name in group}
        wanted = renamed_joints(listed, robot) or robot
        if wanted != robot:
            notes.append(
                f"The joints {wanted[0]} … {wanted[-1]} of the log count as {robot[0]} … "
                f"{robot[-1]} of the robot."
            )
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
    log = _merged(path.name, parts, names, tuple(notes))
    return replace(log, names=robot) if robot and names == wanted else log


def _topic(name: str, topic: str, topics: dict[str, Topic], wanted: tuple[str, ...]) -> str:
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


UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N*m"}
"""Field of JointState → unit."""


class BagReader(LogReader):
    """Reader of a bag; its messages are merged once."""

    @cached_property
    def _messages(self) -> JointLog:
        raw, recipe = self.raw, self.raw.recipe
        robot = () if recipe.joints else raw.joints
        return read_joint_states(raw.hashed(), recipe.topic, recipe.joints, robot)

    def convention(self) -> Recipe:
        """Recipe of the fields that the messages fill; the position is always expected."""
        log = self._messages
        signals: dict[str, Any] = {
            "torque" if key == "effort" else key: Signal(unit=UNITS[key], layout="bag", key=key)
            for key in FIELDS
            if key in log.fields or key == "position"
        }
        return Recipe(time=Time(unit="s", layout="bag"), joints=log.names, **signals)

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Field of JointState that a part of the recipe means."""
        return self._messages.table(_field(kind, part), self.raw.name)

    def rows(self, parts: Mapping[str, Signal | Time]) -> LogRows:
        """Rows of merged messages."""
        keys = {kind: _field(kind, part) for kind, part in parts.items()}
        return self._messages.rows(keys, self.raw.name)

    def extras(self) -> Extras:
        """Names of the joints."""
        return Extras({"joint_names": self._messages.names})

    def remarks(self) -> Texts:
        """Sentences about the messages."""
        return self._messages.remarks


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
