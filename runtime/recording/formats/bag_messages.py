"""Bags → `sensor_msgs/JointState` messages: MCAP, ROS 1 bags, ROS 2 bags (SQLite or MCAP).

Messages are decoded by the definition of JointState that every ROS distribution shares (JSON, CDR
or ROS 1 encoding); definitions in a bag are never compiled. Sizes stated in a file are
accepted only up to the size of the file.
"""

import json
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from runtime.errors import RecordingError
from runtime.recording.formats.bounded_decompression import decompressed, modest, most_of, opened
from runtime.recording.formats.optional_imports import imported
from runtime.recording.formats.tables import MAX_CORRUPT

TYPE = "sensor_msgs/msg/JointState"
KNOWN = {TYPE, "sensor_msgs/JointState", "JointState"}
_NANO = 10**9
_YEAR = 31_556_952 * _NANO
_LATEST = 2**62


class Message(NamedTuple):
    """One JointState: instants in ns, names and as many numbers (or none) per field."""

    topic: str
    stamp: int
    logged: int
    names: tuple[str, ...]
    position: Any
    velocity: Any
    effort: Any


def messages(path: Path, notes: list[str]) -> Iterator[Message]:
    """Yield all JointState messages of a file or bag folder, in the order of the file."""
    source = _of_mcap if path.suffix.lower() == ".mcap" else _of_rosbag
    try:
        for message in source(path, notes):
            if not (0 <= message.stamp < _LATEST and 0 <= message.logged < _LATEST):
                raise ValueError(f"a message of the year {1970 + message.stamp // _YEAR}")
            yield message
    except RecordingError:
        raise
    except Exception as error:  # the libraries raise whatever the damage leads to
        reason = str(error).split("\n", maxsplit=1)[0][:120].rstrip(".")
        raise RecordingError(
            f"{path.name} is expected to be a bag of messages, but cannot be read "
            f"({type(error).__name__}: {reason}); copy it again or repair it with the tools of ROS"
        ) from error


def _of_rosbag(path: Path, _notes: list[str]) -> Iterator[Message]:
    is_ros1 = path.suffix.lower() == ".bag"
    kind = "ROS bags"
    reader = imported("rosbags.rosbag1" if is_ros1 else "rosbags.rosbag2", kind).Reader(path)
    decode = _decoder("ros1" if is_ros1 else "cdr")
    with opened(path, reader) as (bag, decompress):
        wanted = [each for each in bag.connections if each.msgtype == TYPE]
        if not wanted:
            _refuse(path.name, sorted({each.topic for each in bag.connections}))
        for connection, logged, data in bag.messages(connections=wanted):
            yield decode(connection.topic, int(logged), modest(decompress(data)))


def _of_mcap(path: Path, notes: list[str]) -> Iterator[Message]:
    """Yield messages in one pass, which needs no index and also reads a file that was cut short."""
    streams = imported("mcap.stream_reader", "MCAP files")
    size = path.stat().st_size
    with path.open("rb") as file:
        channels = _Channels(path.name)
        reader = streams.StreamReader(file, emit_chunks=True, record_size_limit=size)
        read = 0
        try:
            for record in reader.records:
                yield from _of_record(record, channels, streams)
                read = file.tell()
        except Exception as error:
            broken = type(error).__name__ in {"EndOfFile", "RecordLengthLimitExceeded"}
            if not broken and file.tell() < size:
                raise
            if size - read > MAX_CORRUPT * size:
                raise RecordingError(
                    f"{path.name} is cut short or damaged: of its {size} bytes only the first "
                    f"{read} are whole records; copy it again"
                ) from error
            notes.append(
                f"Warning: {path.name} is cut short; its last {size - read} of {size} bytes are "
                "not a whole record."
            )
    channels.require_any()


def _of_record(record: Any, channels: "_Channels", streams: Any) -> Iterator[Message]:
    kind = type(record).__name__
    if kind == "Chunk":
        record.data, record.compression = _decompressed(record), ""
        for inner in streams.breakup_chunk(record):
            yield from _of_record(inner, channels, streams)
    elif kind == "Schema":
        channels.schemas[record.id] = record.name
    elif kind == "Channel":
        channels.add(record)
    elif kind == "Message" and record.channel_id in channels.wanted:
        topic, decode = channels.wanted[record.channel_id]
        yield decode(topic, record.log_time, modest(record.data))


class _Channels:
    """Channels of an MCAP, and the decoders of those with JointState."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.schemas: dict[int, str] = {}
        self.topics: set[str] = set()
        self.wanted: dict[int, tuple[str, Callable[[str, int, bytes], Message]]] = {}

    def add(self, channel: Any) -> None:
        self.topics.add(channel.topic)
        if self.schemas.get(channel.schema_id) in KNOWN and channel.id not in self.wanted:
            self.wanted[channel.id] = (channel.topic, _decoder(channel.message_encoding))

    def require_any(self) -> None:
        if not self.wanted:
            _refuse(self.name, sorted(self.topics))


def _refuse(name: str, topics: list[str]) -> None:
    raise RecordingError(
        f"{name} is expected to hold messages of {TYPE}, but its topics are "
        f"{', '.join(topics[:8]) or 'none'}; record the topic of the joint states"
    )


def _decompressed(chunk: Any) -> bytes:
    """Records of a chunk, up to the size that it states."""
    size = chunk.uncompressed_size
    if size > most_of(len(chunk.data)):
        raise ValueError(f"a chunk states {size} bytes, beyond the decompression limit")
    data: bytes = chunk.data
    if chunk.compression:
        data = decompressed(data, chunk.compression, size)
    if len(data) != size:
        raise ValueError(f"a chunk of {size} bytes holds {len(data)}")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("the checksum of a chunk is wrong")
    return data


@cache
def _decoder(encoding: str) -> Callable[[str, int, bytes], Message]:
    """Bytes → message, by the name of the encoding."""
    if encoding == "json":
        return _from_json
    if encoding not in {"cdr", "ros1"}:
        raise RecordingError(
            f"messages of JointState are expected in the encoding cdr, ros1 or json, got "
            f"{encoding!r}; record them by ROS"
        )
    types = imported("rosbags.typesys", "ROS messages")
    kind = types.Stores.ROS1_NOETIC if encoding == "ros1" else types.Stores.ROS2_HUMBLE
    store = types.get_typestore(kind)
    decode = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr

    def from_bytes(topic: str, logged: int, data: bytes) -> Message:
        state = decode(data, TYPE)
        stamp = state.header.stamp.sec * _NANO + state.header.stamp.nanosec
        names = tuple(state.name)
        return Message(topic, stamp, logged, names, state.position, state.velocity, state.effort)

    return from_bytes


def _from_json(topic: str, logged: int, data: bytes) -> Message:
    state = json.loads(data)
    stamp = state.get("header", {}).get("stamp", {})
    seconds = next((stamp[key] for key in ("sec", "secs") if key in stamp), 0)
    rest = next((stamp[key] for key in ("nanosec", "nsec", "nsecs") if key in stamp), 0)
    names = tuple(map(str, state["name"]))
    fields = ([_number(x) for x in state.get(k) or ()] for k in ("position", "velocity", "effort"))
    return Message(topic, int(seconds) * _NANO + int(rest), logged, names, *fields)


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)
