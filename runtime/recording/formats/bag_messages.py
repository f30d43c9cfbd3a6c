"""Bags → `sensor_msgs/JointState` messages: MCAP, ROS 1 bags, ROS 2 bags (SQLite or MCAP).

Messages are decoded by the definition of JointState that every ROS distribution shares (JSON, CDR
or ROS 1 encoding); definitions in a bag are never compiled. Against hostile files, sizes stated in
one are accepted only up to the size of the file, decompression is bounded (a few bytes can expand
to gigabytes), and databases have no views (a query that may never end).
"""

import bz2
import json
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from runtime.common.files import text_of
from runtime.errors import RecordingError
from runtime.recording.formats.log_format import imported
from runtime.recording.formats.tables import EXPANSION, MAX_CORRUPT, SLACK

LARGEST_CHUNK = 2**27  # largest decompressed chunk [bytes]; writers make chunks of 1 to 64 MB

LARGEST_MESSAGE = 2**22  # largest JointState [bytes]; a hundred joints take some kilobytes

LARGEST_YAML, DEEPEST = 2**22, 50
"""Largest YAML [characters] and its depth; ROS writes some thousand and 6. Parsers take the square
of both in time."""

_PIECE = 2**20


def most_of(size: int) -> int:
    """Largest number of bytes to which a compressed piece of `size` bytes may be decompressed."""
    return min(LARGEST_CHUNK, EXPANSION * size + SLACK)


def decompressed(data: bytes, codec: str, most: int) -> bytes:
    """Content of a piece in zstd, lz4 or bz2, or its first `most` + 1 bytes."""
    if codec == "zstd":
        zstd = imported("backports.zstd", "compressed bags and MCAP files")
        content = zstd.ZstdDecompressor().decompress(data, max_length=most + 1)
    elif codec == "lz4":
        frame = imported("lz4.frame", "compressed bags and MCAP files")
        content = frame.LZ4FrameDecompressor().decompress(data, max_length=most + 1)
    elif codec == "bz2":
        content = bz2.BZ2Decompressor().decompress(data, max_length=most + 1)
    else:
        raise ValueError(f"the compression {codec!r} is not supported")
    return bytes(content)


@contextmanager
def opened(path: Path, reader: Any) -> Iterator[tuple[Any, Callable[[bytes], bytes]]]:
    """Open a reader of rosbags that decompresses within bounds."""
    if path.is_dir():
        _require_flat(text_of(path / "metadata.yaml"))
    for packed in path.glob("*.zstd"):
        _require_modest(packed)
    is_ros1 = path.suffix.lower() == ".bag"
    with nullcontext() if is_ros1 else _plain_databases(), reader as bag:
        if is_ros1:
            codecs = imported("rosbags.rosbag1.reader", "ROS bags").decompressors
            names = {function: name for name, function in codecs.items()}
            bag.chunks = {
                position: chunk._replace(decompressor=_bounded(names[chunk.decompressor]))
                for position, chunk in bag.chunks.items()
            }
        elif bag.compression_mode == "message":
            bag.storage.metadata = bag.storage.metadata._replace(compression_mode=None)
            yield bag, _bounded("zstd")
            return
        yield bag, bytes


def _bounded(codec: str) -> Callable[[bytes], bytes]:
    if codec == "none":
        return bytes

    def whole(data: bytes) -> bytes:
        most = most_of(len(data))
        content = decompressed(data, codec, most)
        if len(content) > most:
            raise ValueError(f"a chunk of {len(data)} bytes holds more than {most}")
        return content

    return whole


def _require_modest(path: Path) -> None:
    """Decompress a file once without keeping the result."""
    zstd = imported("backports.zstd", "compressed bags")
    size, most = 0, EXPANSION * path.stat().st_size + SLACK
    with zstd.open(path, "rb") as file:
        while piece := file.read(_PIECE):
            size += len(piece)
            if size > most:
                raise ValueError(
                    f"{path.name} expands to more than {most} bytes, the decompression limit"
                )


def modest(message: bytes) -> bytes:
    """The message itself."""
    if len(message) > LARGEST_MESSAGE:
        raise ValueError(f"a message has {len(message)} bytes")
    return message


def _require_flat(text: str) -> None:
    depth = deepest = 0
    for mark in re.findall(r"[\[\]{}]", text[:LARGEST_YAML]):
        depth += 1 if mark in "[{" else -1
        deepest = max(deepest, depth)
    rows = re.search(rf"(?:[-?:][ \t]+){{{DEEPEST}}}", text[:LARGEST_YAML])
    if len(text) > LARGEST_YAML or deepest > DEEPEST or rows:
        raise ValueError("its YAML is longer or deeper than ROS writes it")


@contextmanager
def _plain_databases() -> Iterator[None]:
    """Databases that are opened in this context have no views, and YAML that can be parsed."""
    apsw = imported("apsw", "ROS bags")

    def without_views(connection: Any) -> None:
        connection.config(apsw.SQLITE_DBCONFIG_ENABLE_VIEW, 0)
        with suppress(apsw.Error):  # older databases have no such column
            for (profiles,) in connection.execute("SELECT offered_qos_profiles FROM topics"):
                _require_flat(str(profiles))

    apsw.connection_hooks.append(without_views)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(without_views)


TYPE = "sensor_msgs/msg/JointState"
KNOWN = {TYPE, "sensor_msgs/JointState", "JointState"}
_NANO = 10**9
_YEAR = 31_556_952 * _NANO
_LATEST = 2**62


@dataclass(frozen=True, slots=True, eq=False)
class Message:
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
        channels = _Channels()
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
    if not channels.wanted:
        _refuse(path.name, sorted(channels.topics))


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

    def __init__(self) -> None:
        self.schemas: dict[int, str] = {}
        self.topics: set[str] = set()
        self.wanted: dict[int, tuple[str, Callable[[str, int, bytes], Message]]] = {}

    def add(self, channel: Any) -> None:
        self.topics.add(channel.topic)
        if self.schemas.get(channel.schema_id) in KNOWN and channel.id not in self.wanted:
            self.wanted[channel.id] = (channel.topic, _decoder(channel.message_encoding))


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
    fields = (
        [float("nan") if x is None else float(x) for x in state.get(key) or ()]
        for key in ("position", "velocity", "effort")
    )
    return Message(topic, int(seconds) * _NANO + int(rest), logged, names, *fields)
