"""NPZ archives: all arrays at once, or rows of uncompressed arrays that stay in their file.

Rows are read in place because NumPy maps no array of an archive, and `zipfile` cannot seek in a
member: each block would be read, and hashed by CRC-32, from the beginning of its array on.
"""

import io
import sys
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from runtime.common.files import replacing
from runtime.common.records import record_from_table
from runtime.errors import IdentificationError, RecordingError
from runtime.library import Array
from runtime.recording.formats.tables import EXPANSION, SLACK, LogTable, common_count

MOST_TEXTS = 10_000  # largest number of texts in an array of an NPZ that is read
_LOCAL_HEADER, _LENGTHS = 30, 26  # PKWARE APPNOTE, Sec. 4.3.7
R = TypeVar("R")


def open_npz(data: bytes, name: str) -> dict[str, NDArray]:
    """All arrays of an NPZ; nothing in it is unpickled."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise RecordingError(
                    f"{name} is expected to be an NPZ archive, but holds one bare array; "
                    "save it with numpy.savez(t=…, q=…, …)"
                )
            decoded = sum(m.file_size for m in (archive.zip.infolist() if archive.zip else ()))
            if decoded > EXPANSION * len(data) + SLACK:
                raise RecordingError(
                    f"{name} states {decoded} bytes in {len(data)}, beyond the decompression "
                    "limit; it is damaged, so export it again"
                )
            arrays = {key: archive[key] for key in archive.files}
            for array in arrays.values():
                if array.dtype.kind != "U":
                    continue
                if array.size > MOST_TEXTS:
                    raise RecordingError(
                        f"{name} holds {array.size} texts, more than {MOST_TEXTS}; export it again"
                    )
                # NumPy accepts codes that are not characters, Python fails on them later.
                codes = array.astype(array.dtype.newbyteorder("=")).tobytes()
                if np.frombuffer(codes, dtype=np.uint32).max(initial=0) > sys.maxunicode:
                    raise ValueError("a text holds codes that are not characters")
            return arrays
    except RecordingError:
        raise
    except Exception as error:  # zipfile and numpy raise a dozen kinds on damaged archives
        pickled = "pickle" in str(error).lower()
        came = "it holds pickled Python objects" if pickled else "it is truncated or not an NPZ"
        todo = "save plain float arrays" if pickled else "copy or export it again"
        raise RecordingError(
            f"{name} is expected to be an NPZ of number arrays, but {came}; {todo}"
        ) from error


def write_arrays(path: Path, record: Any, **more: Any) -> None:
    """Write the fields of a data class as an NPZ, as a whole or not at all, and further arrays."""
    with replacing(path) as file:
        np.savez_compressed(file, **more, **arrays_of(record))


def arrays_of(record: Any) -> dict[str, Any]:
    """Fields of a data class, those of data classes in it beside them; None is an empty array."""
    arrays: dict[str, Any] = {}
    for each in fields(record):
        value = getattr(record, each.name)
        if is_dataclass(value):
            arrays |= arrays_of(value)
        else:
            arrays[each.name] = () if value is None else value
    return arrays


def record_from_arrays(kind: type[R], arrays: Mapping[str, NDArray[Any]], name: str) -> R:
    """Data class of the arrays of an NPZ, as `write_arrays` wrote it."""
    return record_from_table(kind, _table(kind, arrays), name, RecordingError)


def _table(kind: Any, arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for each in fields(kind):
        if is_dataclass(each.type):
            table[each.name] = _table(each.type, arrays)
        elif (array := arrays.get(each.name)) is None:
            continue
        elif each.type is Array or (each.type == Array | None and array.size):
            table[each.name] = np.array(array, float)
        elif array.size:
            table[each.name] = array.tolist()
    return table


@contextmanager
def refusing(absent: str, damaged: str) -> Iterator[None]:
    """One sentence on a file of arrays that is absent, and one on any fault in it."""
    try:
        yield
    except FileNotFoundError:
        raise IdentificationError(absent) from None
    except (OSError, RecordingError, ValueError, LookupError, TypeError, OverflowError):
        raise IdentificationError(damaged) from None


def npz_table(arrays: dict[str, NDArray], key: str, name: str) -> LogTable:
    """One array of an NPZ as rows, one per sample."""
    if key not in arrays:
        raise RecordingError(
            f"{name} is expected to hold the array {key!r}, but holds "
            f"{', '.join(sorted(arrays)) or 'nothing'}; add it or name it in a recipe"
        )
    array = arrays[key]
    if array.dtype.kind not in "fiu":
        raise RecordingError(
            f"{name}: the array {key!r} is expected to hold real numbers, "
            f"but is of type {array.dtype}; convert it to float64"
        )
    rows = array.reshape(-1, 1) if array.ndim == 1 else array
    if rows.ndim != 2:
        raise RecordingError(
            f"{name}: the array {key!r} is expected to be (samples, joints), "
            f"but is of shape {array.shape}; reshape it"
        )
    return LogTable(rows.astype(np.float64), np.arange(len(rows), dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class _Array:
    """Place of an array in a file."""

    offset: int
    dtype: np.dtype
    rows: int
    width: int


def texts_in_place(path: Path, keys: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Small arrays of texts of an NPZ that is not read as a whole."""
    content = io.BytesIO()
    try:
        with zipfile.ZipFile(path) as archive, zipfile.ZipFile(content, "w") as copied:
            for member in archive.infolist():
                name = member.filename
                if name.removesuffix(".npy") in keys and member.file_size < SLACK:
                    copied.writestr(name, archive.read(name))
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordingError(f"{path.name} is damaged ({error}); copy or export it again") from None
    arrays = open_npz(content.getvalue(), path.name)
    return {key: tuple(map(str, x.ravel())) for key, x in arrays.items() if x.dtype.kind == "U"}


class NpzRows:
    """Arrays of an NPZ that `numpy.savez` has written, read where they lie."""

    def __init__(self, path: Path, kinds: Mapping[str, str] | None = None) -> None:
        self.path, self.kinds = path, dict(kinds or {})
        try:
            with zipfile.ZipFile(path) as archive, path.open("rb") as file:
                members = archive.infolist()
                located = {m.filename.removesuffix(".npy"): _located(file, m) for m in members}
        except Exception as error:  # zipfile and numpy raise a dozen kinds on damaged archives
            raise RecordingError(
                f"{path.name} is expected to be an NPZ of number arrays, but it is truncated or "
                "not an NPZ; copy or export it again"
            ) from error
        self.keys = tuple(located)
        self.shapes: dict[str, tuple[int, ...]] = {  # of those that can be read in place
            key: (at.rows, at.width) for key, at in located.items() if at is not None
        }
        self._arrays = {kind: self._usable(located, key) for kind, key in self.kinds.items()}
        self.count = common_count(path, (array.rows for array in self._arrays.values()))

    def read(self, start: int, stop: int) -> dict[str, Array]:
        """Rows start … stop of every kind of signal."""
        return {kind: self._slice(array, start, stop) for kind, array in self._arrays.items()}

    def _slice(self, array: _Array, start: int, stop: int) -> Array:
        offset = array.offset + start * array.width * array.dtype.itemsize
        count = (stop - start) * array.width
        values = np.fromfile(self.path, dtype=array.dtype, count=count, offset=offset)
        if len(values) != count:
            raise RecordingError(f"{self.path.name} has become shorter while it was read")
        return values.reshape(-1, array.width).astype(np.float64, copy=False)

    def _usable(self, located: dict[str, _Array | None], key: str) -> _Array:
        array = located.get(key)
        if key not in located:
            raise RecordingError(
                f"{self.path.name} is expected to hold the array {key!r}, but holds "
                f"{', '.join(sorted(located)) or 'nothing'}; add it or name it in a recipe"
            )
        if array is None:
            raise RecordingError(
                f"{self.path.name}: the array {key!r} cannot be read row by row (it is compressed, "
                "in Fortran order, or not a matrix of numbers); write numpy.ascontiguousarray of "
                "it by numpy.savez with samples as rows, or Parquet, or read the log as a whole "
                "with --settings stream=false"
            )
        return array


def _located(file: IO[bytes], member: zipfile.ZipInfo) -> _Array | None:
    """Place of the numbers of a member; None where they cannot be read in place."""
    if member.compress_type != zipfile.ZIP_STORED:
        return None
    file.seek(member.header_offset + _LENGTHS)
    lengths = np.frombuffer(file.read(4), dtype="<u2")
    begin = member.header_offset + _LOCAL_HEADER + int(lengths.sum())
    file.seek(begin)
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0
    if version != (1, 0):
        read = np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read(file)
    offset = file.tell()
    numbers = dtype.kind in "fiu" and 1 <= len(shape) <= 2 and not (by_columns and len(shape) == 2)
    width = shape[1] if len(shape) == 2 else 1
    fits = numbers and shape[0] * width * dtype.itemsize <= begin + member.file_size - offset
    return _Array(offset, dtype, shape[0], width) if fits and width else None
