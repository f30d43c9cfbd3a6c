"""NPZ, Parquet and HDF5 damaged inside: parts of other names, types, shapes and sizes."""

import io
import re
import zipfile
from typing import Any

import numpy as np
from hypothesis import strategies as st

from scripts.fuzzing.drawing import Draw, chance, numbers, pick, pieces

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
MOST_ROWS = 10**5  # of a table that is damaged once more: cells of 5000 numbers still fit


def npz_parts(draw: Draw, data: bytes) -> bytes:
    """Members renamed, dropped, of a huge shape, of another type, pickled, or of endless zeros."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        kept = archive.infolist()[0].compress_type
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = pick(draw, sorted(parts))
    part = parts[name]
    match draw(st.integers(0, 9)):
        case 0:
            parts["../" * 6 + "tmp/hacked.npy"] = parts.pop(name)
        case 1:
            del parts[name]
        case 2:
            parts[name] = _header(part, rb"\([\d, ]*\)", pick(draw, SHAPES))
        case 3:
            parts[name] = _header(part, rb"'<f8'", pick(draw, TYPES))
        case 4:
            parts[name] = _header(part, rb"'<f8'", b"'|O'")[:128] + PICKLE
        case 5:
            parts[name] = _header(part, rb"\(\d+,", b"(40000000,") + bytes(ZEROS)
            kept = zipfile.ZIP_DEFLATED
        case 6:
            parts[name] = numbers(draw, part[:128]) + part[128:]
        case 7:
            parts[name] = parts[pick(draw, sorted(parts))]
        case 8:
            values = np.frombuffer(part[128 : 128 + (len(part) - 128) // 8 * 8])
            parts[name] = part[:128] + strewn(draw, values).tobytes()
        case _:
            parts[name] = pieces(draw, part)
    return _zipped(parts, kept, twice=name if chance(draw, 20) else None)


def strewn(draw: Draw, values: np.ndarray) -> np.ndarray:
    """Some or all doubles replaced by a value that no log has."""
    strange = pick(draw, (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e20, 0.0, 5e-324))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return np.where(rng.random(values.shape) < pick(draw, (0.01, 0.5, 1.0)), strange, values)


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


def parquet_columns(draw: Draw, data: bytes) -> bytes:
    """A whole Parquet file with another column, type, length, page or key."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(data))
    if table.num_rows > MOST_ROWS:  # of a round before this one
        return data
    k, rows = draw(st.integers(0, table.num_columns - 1)), table.num_rows
    name, column = table.column_names[k], table.column(k).combine_chunks()
    strange = _columns(column, rows, pa)
    match draw(st.integers(0, len(strange) + 5)) - len(strange):
        case 0:
            table = table.remove_column(k)
        case 1:
            table = table.append_column(name, column)
        case 2:
            table = table.slice(0, draw(st.integers(0, 2)))
        case 3:
            table = table.rename_columns(["\u202e" if n == name else n for n in table.column_names])
        case 4:
            table = table.replace_schema_metadata({"ARROW:schema": "AAAA", "config_hash": "x"})
        case 5:
            empty = pa.nulls(6 * 10**6, pa.float64())
            table = pa.table(dict.fromkeys(table.column_names, empty))
        case kind:
            table = table.set_column(k, name, strange[kind]())
    out = io.BytesIO()
    codec = pick(draw, ("NONE", "SNAPPY", "ZSTD", "GZIP", "BROTLI"))
    pq.write_table(table, out, compression=codec, data_page_version="2.0")
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


_TYPES = ("f2", "f4", "i8", "u1", "S3", "V8", "c16")
_SHAPES = ((0,), (0, 3), (1,), (7,), (2, 3, 4), (10**6, 1))


def hdf5_parts(draw: Draw, data: bytes) -> bytes:
    """Arrays of other names, types and shapes, compressed zeros, links, and groups in groups."""
    import h5py

    out = io.BytesIO(data)
    with h5py.File(out, "r+") as file:
        group: Any = file.get("arm", file)
        name = pick(draw, sorted(group))
        if group[name].size > MOST_ROWS:  # of a round before this one: an honest file of 400 MB
            return data
        values = np.asarray(group[name])
        del group[name]
        match draw(st.integers(0, 8)):
            case 0:
                group[name + "x"] = values
            case 1:
                group[name] = np.zeros(values.shape, pick(draw, _TYPES))
            case 2:
                group[name] = np.zeros(pick(draw, _SHAPES))
            case 3:
                zeros = {"shape": (10**7, 20), "chunks": (10**5, 20), "compression": "gzip"}
                group.create_dataset(name, dtype="f8", **zeros)
            case 4:
                group[name] = h5py.ExternalLink("../canary.txt", "/q")
            case 5:
                group[name] = h5py.SoftLink(f"/{name}")
            case 6:
                place = group
                for _ in range(200):
                    place = place.create_group(name)
            case 7:
                external = [("../canary.txt", 0, h5py.h5f.UNLIMITED)]
                group.create_dataset(name, values.shape, "f8", external=external)
            case _:
                group[name] = strewn(draw, values)
    return out.getvalue()
