"""Log format bag: sensor_msgs/JointState in MCAP files, ROS 1 bags and ROS 2 bags.

JointState is in SI units by its definition (REP 103). In the recipe, `topic` is that of the
messages, `joints` picks and orders the joints by name, and `key` is a field of JointState.
Publishers of some of the joints each are merged where their stamps are equal.

    publisher   a row per message: stamp, instant of logging, position, velocity, effort
    merged      t and the three fields of the requested joints, sorted, one row per stamp

Neither is held in memory: messages lie in a temporary database of SQLite, which sorts them, and
merged rows in a temporary file.
"""

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count as counted
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array, Integers
from runtime.recording.coupled_joints import renamed_joints
from runtime.recording.formats import FOLDERS
from runtime.recording.formats.bag_messages import Message, messages
from runtime.recording.formats.log_format import Extras, LogFormat, LogReader, LogRows, Texts
from runtime.recording.formats.tables import MAX_CORRUPT, LogTable, Spool, SpooledRows, no_room
from runtime.recording.recipes.recipe import SI, Recipe, Signal, Time

FIELDS = ("position", "velocity", "effort")

PIECE = 2**15  # messages that are merged together

Ticks = Integers


@dataclass(slots=True)
class Publisher:
    """All messages of one topic that name the same joints in the same order."""

    number: int
    names: tuple[str, ...]  # of the joints
    count: int = 0  # number of messages
    last: tuple[int, int] = (-1, -1)  # its two clocks, stamp and instant of logging [ns]
    late: tuple[int, int] = (0, 0)  # how often each of them runs backwards
    stamps_change: bool = False

    def note(self, message: Message) -> None:
        """Count the next message."""
        now = message.stamp, message.logged
        self.stamps_change |= self.count > 0 and now[0] != self.last[0]
        self.late = self.late[0] + (now[0] < self.last[0]), self.late[1] + (now[1] < self.last[1])
        self.last, self.count = now, self.count + 1


class MessageStore:
    """Messages of one bag in a temporary database, which sorts them."""

    def __init__(self, base: sqlite3.Connection) -> None:
        self._base = base
        base.execute("PRAGMA journal_mode = OFF")
        base.execute("CREATE TABLE message (publisher, stamp, logged, numbers)")
        base.execute("CREATE TABLE part (number)")

    @classmethod
    @contextmanager
    def opened(cls, name: str) -> "Iterator[MessageStore]":
        """Database of a bag; its file is deleted when it is closed."""
        with closing(sqlite3.connect("")) as base:
            try:
                yield cls(base)
            except sqlite3.Error as error:
                raise no_room(name, str(error)) from error

    def add(self, publisher: Publisher, message: Message) -> None:
        """Add a message; a field of another length than the names is missing."""
        n = len(publisher.names)
        fields = (message.position, message.velocity, message.effort)
        whole = [field if len(field) == n else np.full(n, np.nan) for field in fields]
        numbers = np.concatenate(whole, dtype=np.float64).tobytes()
        row = (publisher.number, message.stamp, message.logged, numbers)
        self._base.execute("INSERT INTO message VALUES (?, ?, ?, ?)", row)
        publisher.note(message)

    def in_order(
        self, publishers: Sequence[Publisher], by_stamp: bool
    ) -> Iterator[list[tuple[int, int, bytes]]]:
        """Yield ticks, publishers and numbers in pieces; those of one tick stay together."""
        self._base.executemany("INSERT INTO part VALUES (?)", [(p.number,) for p in publishers])
        held: list[tuple[int, int, bytes]] = []
        for message in self._base.execute(
            "SELECT CASE WHEN ? THEN stamp ELSE logged END AS tick, publisher, numbers "
            "FROM message JOIN part ON publisher = number ORDER BY tick, message.rowid",
            (by_stamp,),
        ):
            if len(held) >= PIECE and message[0] != held[-1][0]:
                yield held
                held = []
            held.append(message)
        if held:
            yield held


def merged(
    piece: list[tuple[int, int, bytes]], publishers: Sequence[Publisher], names: tuple[str, ...]
) -> tuple[Ticks, Array]:
    """Ticks [ns] and fields of some joints of a piece of messages; NaN where none has a value.

    Messages of several publishers with one tick are one row, those of a single one are not.
    """
    ticks = np.array([tick for tick, *_ in piece], dtype=np.int64)
    places = np.arange(len(ticks))
    if len(publishers) > 1:
        ticks, places = np.unique(ticks, return_inverse=True)
    filled = np.full((len(ticks), len(FIELDS) * len(names)), np.nan)
    for each in publishers:
        mine = [k for k, (_, number, _) in enumerate(piece) if number == each.number]
        numbers = np.frombuffer(b"".join(piece[k][2] for k in mine))
        values = numbers.reshape(len(mine), len(FIELDS) * len(each.names))
        columns, of_publisher = _columns(each.names, names)
        filled[places[mine][:, None], columns] = values[:, of_publisher]
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
    spool: Spool  # time from the first message on [s], then the three fields


def read_joint_states(
    path: Path, topic: str, wanted: tuple[str, ...], robot: tuple[str, ...] = ()
) -> JointLog:
    """Merged joint states of one topic; wanted: names of the log, robot: those of the robot."""
    with MessageStore.opened(path.name) as store:
        notes: list[str] = []
        topics: dict[str, Topic] = {}
        numbers = counted()
        for message in messages(path, notes):
            publishers = topics.setdefault(message.topic, {})
            if topic and message.topic != topic:
                continue
            if message.names not in publishers:
                publishers[message.names] = Publisher(next(numbers), message.names)
            store.add(publishers[message.names], message)
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
        log = _merged(path.name, parts, names, tuple(notes), store)
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
    name: str,
    parts: Sequence[Publisher],
    names: tuple[str, ...],
    notes: tuple[str, ...],
    store: MessageStore,
) -> JointLog:
    """All messages on one clock, sorted; rows that lack a joint are dropped and counted."""
    by_stamp = sum(p.count for p in parts) < 2 or any(p.stamps_change for p in parts)
    if not by_stamp:
        notes += ("The stamps of the messages do not change; the instants of logging are used.",)
    if late := sum(p.late[0 if by_stamp else 1] for p in parts):
        notes += (f"Sorted {late} messages that came out of order.",)
    spool, start, count, total = Spool(name), 0, 0, 0
    filled = np.zeros(len(FIELDS), dtype=bool)
    for piece in store.in_order(parts, by_stamp):
        ticks, values = merged(piece, parts, names)
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
            kind: Signal(unit=SI[kind], layout="bag", key=key)
            for kind, key in zip(("position", "velocity", "torque"), FIELDS, strict=True)
            if key in log.fields or key == "position"
        }
        return Recipe(time=Time(unit="s", layout="bag"), joints=log.names, **signals)

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Field of JointState that a part of the recipe means."""
        log = self._messages
        values = self.rows({kind: part}).read(0, log.count)[kind]
        return LogTable(values.copy(), np.arange(log.count, dtype=np.int64), log.remarks)

    def rows(self, parts: Mapping[str, Signal | Time]) -> LogRows:
        """Rows of merged messages."""
        log, n = self._messages, len(self._messages.names)
        places = {}
        for kind, part in parts.items():
            key = part.key or {"time": "", "torque": "effort"}.get(kind, kind)
            if key and key not in log.fields:
                raise RecordingError(
                    f"{self.raw.name} is expected to hold the {key} of the joints, but its "
                    f"messages hold {', '.join(log.fields)} of JointState; leave it out of the "
                    "recipe"
                )
            first = 1 + n * FIELDS.index(key) if key else 0
            places[kind] = slice(first, first + n) if key else slice(0, 1)
        return SpooledRows(log.spool, 1 + n * len(FIELDS), places)

    def extras(self) -> Extras:
        """Names of the joints."""
        return Extras({"joint_names": self._messages.names})

    def remarks(self) -> Texts:
        """Sentences about the messages."""
        return self._messages.remarks


BAG = LogFormat(
    name="bag",
    sentence="messages of sensor_msgs/JointState in MCAP, a ROS 1 bag or a ROS 2 bag",
    suffixes=(".mcap", ".bag", ".db3"),
    reader=BagReader,
    marker=FOLDERS["bag"],
    is_one_file=True,
)
