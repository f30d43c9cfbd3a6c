"""Rows of arrays that stay in their file: uncompressed NPZ, and Parquet batch by batch.

A source gives the rows start … stop of several kinds of signals and holds no more than these.
"""

import zipfile
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.formats.parquet import ParquetLog

FloatArray = NDArray[np.float64]
_LOCAL_HEADER, _LENGTHS = 30, 26  # PKWARE APPNOTE, Sec. 4.3.7


class Rows(Protocol):
    """Rows of one file."""

    @property
    def count(self) -> int:
        """The number of rows."""

    def read(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Kind → its rows start … stop, (stop − start, m)."""


@dataclass(frozen=True, slots=True)
class _Array:
    """Where an array lies in a file."""

    offset: int
    dtype: np.dtype
    rows: int
    width: int


class NpzRows:
    """Arrays of an NPZ that `numpy.savez` has written, read where they lie.

    Raises:
        RecordingError: compressed, damaged, or no NPZ.
    """

    def __init__(self, path: Path, kinds: Mapping[str, str] | None = None) -> None:
        self.path, self.kinds = path, dict(kinds or {})
        try:
            with zipfile.ZipFile(path) as archive, path.open("rb") as file:
                members = archive.infolist()
                found = {m.filename.removesuffix(".npy"): _located(file, m) for m in members}
        except Exception as error:  # zipfile and numpy raise a dozen kinds on damaged archives
            raise RecordingError(
                f"{path.name} is expected to be an NPZ of number arrays, but it is truncated or "
                "none at all; copy or export it again"
            ) from error
        self.keys = tuple(found)
        self._arrays = {kind: self._usable(found, key) for kind, key in self.kinds.items()}
        counts = sorted({array.rows for array in self._arrays.values()})
        if len(counts) > 1:
            raise RecordingError(
                f"{path.name} is expected to have as many rows of every signal, but there are "
                f"{' and '.join(map(str, counts))}; check that samples are rows"
            )
        self.count = counts[0] if counts else 0

    def read(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Kind → its rows start … stop."""
        return {kind: self._slice(array, start, stop) for kind, array in self._arrays.items()}

    def _slice(self, array: _Array, start: int, stop: int) -> FloatArray:
        offset = array.offset + start * array.width * array.dtype.itemsize
        count = (stop - start) * array.width
        values = np.fromfile(self.path, dtype=array.dtype, count=count, offset=offset)
        if len(values) != count:
            raise RecordingError(f"{self.path.name} has become shorter while it was read")
        return values.reshape(-1, array.width).astype(np.float64, copy=False)

    def _usable(self, found: dict[str, _Array | None], key: str) -> _Array:
        array = found.get(key)
        if key not in found:
            raise RecordingError(
                f"{self.path.name} is expected to hold the array {key!r}, but holds "
                f"{', '.join(sorted(found)) or 'nothing'}; add it or name it in a recipe"
            )
        if array is None:
            raise RecordingError(
                f"{self.path.name}: the array {key!r} cannot be read row by row (it is compressed, "
                "or no matrix of numbers); write it by numpy.savez with samples as rows, or as "
                "Parquet, or read the log as a whole with --no-stream"
            )
        return array


def _located(file: IO[bytes], member: zipfile.ZipInfo) -> _Array | None:
    """Where the numbers of a member begin; None where they cannot be read in place."""
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


class ParquetRows:
    """Columns of a Parquet file; reading forwards costs one pass, going back begins anew."""

    def __init__(self, log: ParquetLog, kinds: Mapping[str, tuple[str, ...]]) -> None:
        self._log, self._kinds = log, dict(kinds)
        self._columns = tuple(column for columns in self._kinds.values() for column in columns)
        self.count = log.rows
        self._held: deque[dict[str, FloatArray]] = deque()
        self._first = self._next = 0
        self._batches = log.batches(self._columns, 0)

    def read(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Kind → its rows start … stop."""
        group = self._log.group_start(start)
        if start < self._first or group > self._next:
            self._held.clear()
            self._first = self._next = group
            self._batches = self._log.batches(self._columns, group)
        self._forget(start)
        while self._next < stop:
            batch = next(self._batches, None)
            if batch is None:
                raise RecordingError(f"{self._log.name} holds fewer rows than it claims")
            self._held.append({kind: batch.numbers(c) for kind, c in self._kinds.items()})
            self._next += len(next(iter(self._held[-1].values())))
            self._forget(start)
        whole = {kind: np.concatenate([part[kind] for part in self._held]) for kind in self._kinds}
        at = start - self._first
        return {kind: values[at : at + stop - start] for kind, values in whole.items()}

    def _forget(self, start: int) -> None:
        while self._held:
            length = len(next(iter(self._held[0].values())))
            if self._first + length > start:
                return
            self._held.popleft()
            self._first += length
