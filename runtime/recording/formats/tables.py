"""A table of numbers, in which each corrupt row is NaN and keeps its line; numbers in a file."""

import tempfile
import weakref
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array, Integers

Columns = tuple[str | int, ...]
MAX_CORRUPT = 0.2  # largest share of corrupt rows of a log that is read
EXPANSION, SLACK = 50, 2**26
"""Decompression limit: a file may decode to at most EXPANSION · size + SLACK bytes. Signals with
noise shrink to a half as numbers and to a tenth as text."""


@dataclass(frozen=True, slots=True, eq=False)
class LogTable:
    """Rows of numbers and where they come from."""

    values: Array  # (N, m) numbers; a corrupt row is NaN
    lines: Integers  # (N,) line of the file, or index, of each row
    remarks: tuple[str, ...] = ()  # sentences about the form of the file


Tables = dict[str, LogTable]  # kind of signal → rows in the units of the file


def picked(table: LogTable, columns: Columns, what: str) -> LogTable:
    """Numbers of an array that a recipe picks by index; all where it names none."""
    if not columns:
        return table
    width = table.values.shape[1]
    picks = [c for c in columns if isinstance(c, int) and 0 <= c < width]
    if len(picks) < len(columns):
        wrong = next(c for c in columns if c not in picks)
        raise RecordingError(
            f"{what} has {width} numbers per row, counted from 0 and without names, but the recipe "
            f"names {wrong!r}; correct columns in the recipe"
        )
    return replace(table, values=table.values[:, picks])


def common_count(path: Path, counts: Iterable[int]) -> int:
    """Number of rows of all signals of a file."""
    different = sorted(set(counts))
    if len(different) > 1:
        raise RecordingError(
            f"{path.name} is expected to have as many rows of every signal, but there are "
            f"{' and '.join(map(str, different))}; check that samples are rows"
        )
    return different[0] if different else 0


def no_room(name: str, reason: str | None) -> RecordingError:
    """Error of a log whose numbers a temporary file cannot take."""
    return RecordingError(
        f"the numbers of {name} do not fit into {tempfile.gettempdir()} ({reason}); set TMPDIR to "
        "a larger place, or convert the log to Parquet"
    )


class Spool:
    """Sequence of numbers in a temporary file, which stays in memory while it is small."""

    SMALL = 2**24  # largest size that stays in memory [bytes]

    def __init__(self, name: str) -> None:
        self._name = name  # of the log, for messages
        self._file = tempfile.SpooledTemporaryFile(self.SMALL, prefix="symgen-")  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self.size = 0

    def append(self, values: Array) -> int:
        """Append numbers and return the place of the first of them."""
        start = self.size
        try:
            self._file.seek(8 * start)
            self._file.write(np.ascontiguousarray(values).data)
        except OSError as error:
            raise no_room(self._name, error.strerror) from error
        self.size += values.size
        return start

    def read(self, start: int, count: int) -> Array:
        """Numbers from a place on."""
        self._file.seek(8 * start)
        return np.frombuffer(self._file.read(8 * count), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class SpooledRows:
    """Numbers of a spool as rows of several signals."""

    spool: Spool  # row by row
    width: int  # of a row
    places: dict[str, slice]  # kind → its columns

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.spool.size // self.width

    def read(self, start: int, stop: int) -> dict[str, Array]:
        """Rows start … stop of every kind of signal."""
        rows = self.spool.read(start * self.width, (stop - start) * self.width)
        table = rows.reshape(-1, self.width)
        return {kind: table[:, place] for kind, place in self.places.items()}
