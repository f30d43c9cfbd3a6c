"""Bags of JointState messages, good ones, and whole containers whose messages are damaged."""

import io
import json
import shutil
import sqlite3
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from runtime.recording import Recording
from scripts.fuzzing.drawing import Draw, Mutator, chance, pick

Payloads = list[tuple[int, bytes]]
"""Instants in ns and encoded messages."""

TYPE, TOPIC = "sensor_msgs/msg/JointState", "/joint_states"
START = 1_700_000_000 * 10**9
ZEROS = 2 * 10**8  # bytes of a chunk that is nothing but zeros


def payloads(log: Recording, encoding: str) -> Payloads:
    """The messages of a log: json, cdr or ros1."""
    names = [f"joint{i}" for i in range(log.q.shape[1])]
    tau = np.zeros_like(log.q) if log.tau is None else log.tau
    made = []
    for t, q, effort in zip(log.t, log.q, tau, strict=True):
        stamp = START + round(1e9 * t)
        made.append((stamp, _encoded(encoding, stamp, names, q, effort)))
    return made


@cache
def _types(is_ros1: bool) -> Any:
    """Types of messages, which generate their code at the first message of a type."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)


def _encoded(
    encoding: str, stamp: int, names: list[str], q: np.ndarray, effort: np.ndarray
) -> bytes:
    sec, nanosec = divmod(stamp, 10**9)
    if encoding == "json":
        head = {"stamp": {"sec": sec, "nanosec": nanosec}}
        messages = {"header": head, "name": names, "position": [*q], "effort": [*effort]}
        return json.dumps(messages).encode()
    is_ros1 = encoding == "ros1"
    store = _types(is_ros1)
    time = store.types["builtin_interfaces/msg/Time"](sec, nanosec)
    extra = {"seq": 0} if is_ros1 else {}
    header = store.types["std_msgs/msg/Header"](stamp=time, frame_id="", **extra)
    state = store.types[TYPE](header, names, np.array(q), np.zeros(0), np.array(effort))
    return bytes((store.serialize_ros1 if is_ros1 else store.serialize_cdr)(state, TYPE))


def mcap(messages: Payloads, encoding: str, compression: str = "NONE") -> bytes:
    """An MCAP file."""
    from mcap.writer import CompressionType, Writer

    out = io.BytesIO()
    writer = Writer(out, chunk_size=4096, compression=CompressionType[compression])
    writer.start()
    schema = writer.register_schema(TYPE, "jsonschema" if encoding == "json" else "ros2msg", b"{}")
    channel = writer.register_channel(TOPIC, encoding, schema)
    for stamp, data in messages:
        writer.add_message(channel, stamp, data, stamp)
    writer.finish()
    return out.getvalue()


def ros1(messages: Payloads, compression: str = "") -> bytes:
    """A ROS 1 bag."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.bag"
        bag = Writer(path)
        if compression:
            bag.set_compression(Writer.CompressionFormat[compression])
        with bag:
            connection = bag.add_connection(TOPIC, TYPE, typestore=store)
            for stamp, data in messages:
                bag.write(connection, stamp, data)
        return path.read_bytes()


def ros2(folder: Path, messages: Payloads, mode: str = "NONE") -> None:
    """A ROS 2 bag, a folder that must not exist."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    bag = Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3)
    if mode != "NONE":
        bag.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with bag:
        connection = bag.add_connection(TOPIC, TYPE, typestore=store)
        for stamp, data in messages:
            bag.write(connection, stamp, data)


def with_some(draw: Draw, messages: Payloads, mutate: Mutator) -> Payloads:
    """Some messages damaged, doubled, left out, or of another instant."""
    changed = list(messages)
    for _ in range(min(draw(st.integers(1, 5)), len(changed) - 1)):
        k = draw(st.integers(0, len(changed) - 1))
        stamp, data = changed[k]
        match draw(st.integers(0, 5)):
            case 0:
                changed.insert(k, pick(draw, changed))
            case 1:
                del changed[k]
            case 2:
                changed[k] = (pick(draw, (0, 1, START - 1, 2**32 * 10**9 - 1)), data)
            case _:
                changed[k] = (stamp, mutate(draw, data))
    return changed


def remade(
    read: Callable[[bytes], Payloads],
    write: Callable[[Payloads, str], bytes],
    codecs: tuple[str, ...],
    mutate: Mutator,
) -> Mutator:
    """A bag whose container is whole, or whose chunk is a bomb."""

    def remake(draw: Draw, data: bytes) -> bytes:
        messages = read(data)
        if max(len(message) for _, message in messages) >= ZEROS:
            return data  # a bomb of a round before, which would become an honest file of 200 MB
        if chance(draw, 25):
            return write([(messages[0][0], bytes(ZEROS))], pick(draw, codecs[1:]))
        return write(with_some(draw, messages, mutate), pick(draw, codecs))

    return remake


def remade_mcap(encoding: str, mutate: Mutator) -> Mutator:
    """An MCAP whose container is whole."""

    def read(data: bytes) -> Payloads:
        from mcap.reader import make_reader

        reader = make_reader(io.BytesIO(data))
        return [(message.log_time, message.data) for _, _, message in reader.iter_messages()]

    def write(messages: Payloads, codec: str) -> bytes:
        return mcap(messages, encoding, codec)

    return remade(read, write, ("NONE", "LZ4", "ZSTD"), mutate)


def remade_ros1(mutate: Mutator) -> Mutator:
    """A ROS 1 bag whose container is whole."""

    def read(data: bytes) -> Payloads:
        from rosbags.rosbag1 import Reader

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log.bag"
            path.write_bytes(data)
            with Reader(path) as bag:
                return [(stamp, message) for _, stamp, message in bag.messages()]

    return remade(read, ros1, ("", "BZ2", "LZ4"), mutate)


ENDLESS = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT count(x) AS "
QUERIES = (
    "UPDATE messages SET data = NULL",
    "UPDATE messages SET data = 'text'",
    "UPDATE messages SET data = zeroblob(1000000) WHERE id = 3",
    "UPDATE messages SET data = substr(data, 1, 40)",
    "UPDATE messages SET timestamp = -1 WHERE id % 2",
    "UPDATE messages SET timestamp = 9223372036854775807",
    "UPDATE messages SET timestamp = 'x'",
    "UPDATE messages SET topic_id = NULL",
    "UPDATE topics SET type = 'std_msgs/msg/String'",
    "UPDATE topics SET offered_qos_profiles = '" + "[" * 3000 + "'",
    "UPDATE topics SET offered_qos_profiles = '!!python/object/apply:os.system [touch hacked]'",
    "UPDATE topics SET name = X'ff00'",
    "UPDATE schema SET schema_version = 'x'",
    "DELETE FROM messages",
    "DROP TABLE messages",
    "DROP TABLE schema",
    "ALTER TABLE messages RENAME COLUMN data TO payload",
    f"DROP TABLE schema; CREATE VIEW schema AS {ENDLESS} schema_version FROM n",
    f"DROP TABLE message_definitions; CREATE VIEW message_definitions AS {ENDLESS} id FROM n",
)


def remade_database(draw: Draw, data: bytes) -> bytes:
    """A database whose pages are whole."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag.db3"
        path.write_bytes(data)
        with sqlite3.connect(path) as database:
            database.executescript(pick(draw, QUERIES))
        database.close()
        return path.read_bytes()


def furnish_ros2(folder: Path, log: Recording, mode: str) -> None:
    """The folder `bag`, as `mode` compresses it."""
    shutil.rmtree(folder / "bag", ignore_errors=True)
    ros2(folder / "bag", payloads(log, "cdr"), mode)


def zstd_bomb(draw: Draw, data: bytes) -> bytes:
    """The zstd frame of a bag that is compressed as a whole, of endless zeros or damaged."""
    from backports import zstd

    return zstd.compress(bytes(ZEROS)) if chance(draw, 20) else data
