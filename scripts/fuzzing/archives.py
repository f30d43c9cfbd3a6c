"""NPZ and Parquet damaged inside: members and columns of other names, types, shapes and sizes."""

import io
import re
import zipfile
from typing import Any

import numpy as np

from scripts.fuzzing.mutators import flip_bits, numbers

Rng = np.random.Generator

SHAPES = (
    *(b"(99999999999,)", b"(1000000000000, 7)", b"(-1,)", b"(2,3,4)", b"(0,)", b"(0, 7)", b"()"),
    *(b"(9223372036854775807,)", b"(1" + b"0" * 40 + b",)", b"(1.5,)", b"(True,)", b"(1, 1)"),
)
TYPES = (
    *(b"'|O'", b"'<c16'", b"'<U9'", b"'<i8'", b"'V8'", b"'<f2'", b"'>f8'", b"'<M8[s]'", b"'|b1'"),
    *(b"[('a', '<f8')]", b"'<U999999999'", b"'S0'", b"__import__('os').system('touch hacked')"),
)
PICKLE = b"cos\nsystem\n(S'touch hacked'\ntR."
ZEROS = 10**8
MOST_ROWS = 10**5
"""Of a table that is damaged once more: cells of 5000 numbers still fit."""


def npz_parts(data: bytes, rng: Rng) -> bytes:
    """Members renamed, dropped, of a huge shape, of another type, pickled, or of endless zeros."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            kept = archive.infolist()[0].compress_type
            parts = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # damaged before
        return data
    name = sorted(parts)[int(rng.integers(len(parts)))]
    kind = int(rng.integers(10))
    if kind == 0:
        parts["../" * 6 + "tmp/hacked.npy"] = parts.pop(name)
    elif kind == 1:
        del parts[name]
    elif kind == 2:
        parts[name] = _header(parts[name], rb"\([\d, ]*\)", SHAPES[int(rng.integers(len(SHAPES)))])
    elif kind == 3:
        parts[name] = _header(parts[name], rb"'<f8'", TYPES[int(rng.integers(len(TYPES)))])
    elif kind == 4:
        parts[name] = _header(parts[name], rb"'<f8'", b"'|O'")[:128] + PICKLE
    elif kind == 5:
        parts[name] = _header(parts[name], rb"\(\d+,", b"(40000000,") + bytes(ZEROS)
        kept = zipfile.ZIP_DEFLATED
    elif kind == 6:
        parts[name] = numbers(parts[name][:128], rng) + parts[name][128:]
    elif kind == 7:
        parts[name] = parts[sorted(parts)[int(rng.integers(len(parts)))]]
    elif kind == 8:
        parts[name] = parts[name][:128] + _filled(parts[name][128:], rng)
    else:
        parts[name] = flip_bits(parts[name], rng)
    return _zipped(parts, kept, twice=name if int(rng.integers(20)) == 0 else None)


def _filled(data: bytes, rng: Rng) -> bytes:
    """Replace some or all doubles by a value that no log has."""
    values = np.frombuffer(data[: len(data) // 8 * 8], dtype=np.float64).copy()
    strange = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e20, 0.0, 5e-324])
    if values.size:
        some = rng.random(values.size) < rng.choice([0.01, 0.5, 1.0])
        values[some] = strange
    return values.tobytes()


def _header(part: bytes, pattern: bytes, text: bytes) -> bytes:
    """An NPY with a piece of its header replaced, the header as long as before."""
    size = 10 + int.from_bytes(part[8:10], "little")
    head = re.sub(pattern, lambda _: text, part[:size].rstrip(), count=1)
    return head.ljust(size - 1)[: size - 1] + b"\n" + part[size:]


def _zipped(parts: dict[str, bytes], kept: int, twice: str | None) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", kept, compresslevel=1) as archive:
        for key, value in parts.items():
            archive.writestr(zipfile.ZipInfo(key), value, kept, 1)
            if key == twice:
                archive.fp.write(value[:64])  # type: ignore[union-attr]  members that overlap
    return out.getvalue()


def parquet_columns(data: bytes, rng: Rng) -> bytes:
    """A whole Parquet file with another column, type, length, page or key."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(data))
    except Exception:  # damaged before
        return data
    if not table.num_columns or table.num_rows > MOST_ROWS:  # of a round before this one
        return data
    k, rows = int(rng.integers(table.num_columns)), table.num_rows
    name, column = table.column_names[k], table.column(k).combine_chunks()
    strange = _columns(column, rows, pa)
    kind = int(rng.integers(len(strange) + 6))
    if kind < len(strange):
        table = table.set_column(k, name, strange[kind]())
    elif kind == len(strange):
        table = table.remove_column(k)
    elif kind == len(strange) + 1:
        table = table.append_column(name, column)
    elif kind == len(strange) + 2:
        table = table.slice(0, int(rng.integers(0, 3)))
    elif kind == len(strange) + 3:
        table = table.rename_columns(["\u202e" if n == name else n for n in table.column_names])
    elif kind == len(strange) + 4:
        table = table.replace_schema_metadata({"ARROW:schema": "AAAA", "config_hash": "x"})
    else:
        empty = pa.nulls(6 * 10**6, pa.float64())
        table = pa.table(dict.fromkeys(table.column_names, empty))
    out = io.BytesIO()
    codec = ("NONE", "SNAPPY", "ZSTD", "GZIP", "BROTLI")[int(rng.integers(5))]
    try:
        pq.write_table(table, out, compression=codec, data_page_version="2.0")
    except Exception:  # not every type has a place in Parquet
        return data
    return out.getvalue()


def _columns(column: Any, rows: int, pa: Any) -> tuple[Any, ...]:
    """Functions that make columns of other types, or of numbers that no log has."""

    def of(value: Any, kind: Any) -> Any:
        return lambda: pa.array([value] * rows, kind)

    deep = pa.float64()
    for _ in range(60):
        deep = pa.list_(deep)
    return (
        of("x", pa.string()),
        of("x" * 10_000, pa.string()),
        of(None, pa.null()),
        of(None, pa.float64()),
        of(float("nan"), pa.float64()),
        of(1e308, pa.float64()),
        of(2**63 - 1, pa.int64()),
        of(True, pa.bool_()),
        of(b"\x80", pa.binary()),
        of([], pa.list_(pa.float64())),
        of([1.0] * 5000, pa.list_(pa.float64())),
        of(None, deep),
        of({"a": 1.0}, pa.struct([("a", pa.float64())])),
        of(1, pa.timestamp("ns")),
        of(1.5, pa.float16()),
        lambda: pa.array([[1.0] * (i % 4) for i in range(rows)], pa.list_(pa.float64())),
        lambda: pa.array([None if i % 3 else [1.0] for i in range(rows)], pa.list_(pa.float64())),
        column.dictionary_encode,
    )
