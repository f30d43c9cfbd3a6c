"""JointState messages → rows on one clock, in order, through temporary files.

    publisher   a row per message: stamp, instant of logging, position, velocity, effort
    merged      t and the three fields of the requested joints, sorted, one row per stamp

Neither is held in memory. A row is yielded only when no earlier row can follow, so that late
messages are sorted in.
"""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.recording.formats.bag_messages import Message
from runtime.recording.formats.spool import Spool

FIELDS = ("position", "velocity", "effort")
PIECE = 2**15
"""Messages of a publisher that are written to the spool together."""
Ticks = NDArray[np.int64]
FloatArray = NDArray[np.float64]


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
    """All messages of one topic that name the same joints in the same order.

    Attributes:
        names: of the joints.
        spool: temporary file of the rows.
        stamps, logged: its two clocks.
        count: number of messages.
    """

    names: tuple[str, ...]
    spool: Spool
    stamps: Clock = field(default_factory=Clock)
    logged: Clock = field(default_factory=Clock)
    count: int = 0
    _places: list[tuple[int, int, int, int]] = field(default_factory=list)
    _ticks: array = field(default_factory=lambda: array("q"))
    _values: array = field(default_factory=lambda: array("d"))

    def add(self, message: Message) -> None:
        """Add a message; a field of another length than the names is missing."""
        self.stamps.tick(message.stamp)
        self.logged.tick(message.logged)
        self._ticks.extend((message.stamp, message.logged))
        blank = [np.nan] * len(self.names)
        for values in message[4:]:
            whole = values if len(values) == len(self.names) else blank
            self._values.frombytes(np.asarray(whole, dtype=np.float64).tobytes())
        self.count += 1
        if len(self._ticks) == 2 * PIECE:
            self._write()

    def in_order(self, by_stamp: bool) -> Iterator[tuple[Ticks, FloatArray]]:
        """Yield pieces of ticks (k,) [ns] and fields (k, 3 n), sorted by one of the clocks."""
        self._write()
        ticks, values = np.zeros(0, dtype=np.int64), np.zeros((0, 3 * len(self.names)))
        earliest = [place[2 if by_stamp else 3] for place in self._places]
        for k, (start, count, *_) in enumerate(self._places):
            more = self._piece(start, count, by_stamp)
            ticks, values = np.concatenate([ticks, more[0]]), np.concatenate([values, more[1]])
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

    def _piece(self, start: int, count: int, by_stamp: bool) -> tuple[Ticks, FloatArray]:
        width = 3 * len(self.names)
        numbers = self.spool.read(start, count * (2 + width))
        ticks = numbers[: 2 * count].view(np.int64).reshape(-1, 2)[:, 0 if by_stamp else 1]
        return ticks, numbers[2 * count :].reshape(-1, width)


def merged(
    publishers: Sequence[Publisher], names: tuple[str, ...], by_stamp: bool
) -> Iterator[tuple[Ticks, FloatArray]]:
    """Yield pieces of ticks and fields of some joints; NaN where no message has a value.

    Returns (k,) [ns].
    """
    if len(publishers) == 1:
        columns = _columns(publishers[0].names, names)[1]
        for ticks, values in publishers[0].in_order(by_stamp):
            yield ticks, values[:, columns]
        return
    more = {k: each.in_order(by_stamp) for k, each in enumerate(publishers)}
    held: dict[int, tuple[Ticks, FloatArray]] = {}
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
    parts: list[tuple[tuple[str, ...], Ticks, FloatArray]], names: tuple[str, ...]
) -> tuple[Ticks, FloatArray]:
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
