"""Decompression of bags within a limit, and databases without views.

A few bytes can expand to gigabytes, and a view of a database is a query that may never end.
"""

import bz2
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from runtime.files import text_of
from runtime.recording.formats.optional_imports import imported
from runtime.recording.formats.tables import EXPANSION, SLACK

LARGEST_CHUNK = 2**27
"""Largest decompressed chunk [bytes]; writers make chunks of 1 to 64 MB."""
LARGEST_MESSAGE = 2**22
"""Largest JointState [bytes]; a hundred joints take some kilobytes."""
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
