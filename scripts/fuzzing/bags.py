"""Bags of JointState messages, good ones, and whole containers whose messages are damaged."""

import io
import json
import shutil
import sqlite3
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from runtime.recording import Recording

Rng = np.random.Generator
Payloads = list[tuple[int, bytes]]
"""Instants in ns and encoded messages."""
Mutator = Callable[[bytes, Rng], bytes]

TYPE, TOPIC = "sensor_msgs/msg/JointState", "/joint_states"
START = 1_700_000_000 * 10**9
ZEROS = 2 * 10**8
"""Bytes of a chunk that is nothing but zeros."""


def payloads(log: Recording, encoding: str) -> Payloads:
    """The messages of a log: json, cdr or ros1."""
    names = [f"joint{i}" for i in range(log.q.shape[1])]
    tau = np.zeros_like(log.q) if log.tau is None else log.tau
    made = []
    for t, q, effort in zip(log.t, log.q, tau, strict=True):
        stamp = START + round(1e9 * t)
        made.append((stamp, _encoded(encoding, stamp, names, q, effort)))
    return made


def _encoded(
    encoding: str, stamp: int, names: list[str], q: np.ndarray, effort: np.ndarray
) -> bytes:
    sec, nanosec = divmod(stamp, 10**9)
    if encoding == "json":
        head = {"stamp": {"sec": sec, "nanosec": nanosec}}
        messages = {"header": head, "name": names, "position": [*q], "effort": [*effort]}
        return json.dumps(messages).encode()
    from rosbags.typesys import Stores, get_typestore

    is_ros1 = encoding == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
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


def with_some(messages: Payloads, mutate: Mutator, rng: Rng) -> Payloads:
    """Some messages damaged, doubled, left out, or of another instant."""
    changed = list(messages)
    for _ in range(int(rng.integers(1, 6))):
        if not changed:
            break
        k = int(rng.integers(len(changed)))
        stamp, data = changed[k]
        kind = int(rng.integers(6))
        if kind <= 2:
            changed[k] = (stamp, mutate(data, rng))
        elif kind == 3:
            changed.insert(k, changed[int(rng.integers(len(changed)))])
        elif kind == 4:
            del changed[k]
        else:
            changed[k] = (int(rng.choice([0, 1, START - 1, 2**32 * 10**9 - 1])), data)
    return changed or messages[:1]


def remade_mcap(encoding: str, mutate: Mutator) -> Mutator:
    """An MCAP whose container is whole, or whose chunk is a bomb."""

    def remade(data: bytes, rng: Rng) -> bytes:
        messages = messages_of(data)
        if not messages or _is_bomb(messages):
            return data
        compression = str(rng.choice(["NONE", "LZ4", "ZSTD"]))
        if int(rng.integers(25)) == 0:
            messages = [(messages[0][0], bytes(ZEROS))]
            compression = str(rng.choice(["LZ4", "ZSTD"]))
        return mcap(with_some(messages, mutate, rng), encoding, compression)

    return remade


def _is_bomb(messages: Payloads) -> bool:
    """Whether a round before this one made a bomb, which would become an honest file of 200 MB."""
    return max(len(data) for _, data in messages) >= ZEROS


def messages_of(data: bytes) -> Payloads:
    """The messages of an MCAP that is whole; none of another."""
    from mcap.reader import make_reader

    try:
        reader = make_reader(io.BytesIO(data))
        return [(message.log_time, message.data) for _, _, message in reader.iter_messages()]
    except Exception:  # damaged before
        return []


def remade_ros1(mutate: Mutator) -> Mutator:
    """A ROS 1 bag whose container is whole, or whose chunk is a bomb."""

    def remade(data: bytes, rng: Rng) -> bytes:
        from rosbags.rosbag1 import Reader

        try:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "log.bag"
                path.write_bytes(data)
                with Reader(path) as bag:
                    messages = [(stamp, message) for _, stamp, message in bag.messages()]
        except Exception:  # damaged before
            return data
        if not messages or _is_bomb(messages):
            return data
        compression = str(rng.choice(["", "BZ2", "LZ4"]))
        if int(rng.integers(25)) == 0:
            messages, compression = (
                [(messages[0][0], bytes(ZEROS))],
                str(rng.choice(["BZ2", "LZ4"])),
            )
            return ros1(messages, compression)
        return ros1(with_some(messages, mutate, rng), compression)

    return remade


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


def remade_database(data: bytes, rng: Rng) -> bytes:
    """A database whose pages are whole."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag.db3"
        path.write_bytes(data)
        try:
            with sqlite3.connect(path) as database:
                database.executescript(QUERIES[int(rng.integers(len(QUERIES)))])
            database.close()
        except sqlite3.Error:  # damaged before
            return data
        return path.read_bytes()


def furnish_ros2(folder: Path, log: Recording, mode: str) -> None:
    """The folder `bag`, as `mode` compresses it."""
    shutil.rmtree(folder / "bag", ignore_errors=True)
    ros2(folder / "bag", payloads(log, "cdr"), mode)


def zstd_bomb(data: bytes, rng: Rng) -> bytes:
    """The zstd frame of a bag that is compressed as a whole, of endless zeros or damaged."""
    from backports import zstd

    return zstd.compress(bytes(ZEROS)) if int(rng.integers(20)) == 0 else data
