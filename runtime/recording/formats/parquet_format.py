"""Log format Parquet: columns of numbers, or one column of lists per signal, in batches of rows.

By the convention of CSV the columns are t, q1 … qn, …; by that of NPZ they are t, q, …, where a
cell of q is a list of n numbers. Nothing but numbers is decoded.
"""

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import IO, Any

import numpy as np

from runtime.common.files import require_file
from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.formats.log_format import LogFormat, LogReader, LogRows, imported, undamaged
from runtime.recording.formats.tables import EXPANSION, SLACK, Columns, LogTable
from runtime.recording.recipes import default_convention
from runtime.recording.recipes.recipe import Recipe, Signal, Time
from runtime.recording.recording import Recording

KIND = "a Parquet file"
BATCH, HEAD = 65536, 50  # rows of a batch, and those in which titles are compared with numbers

MOST_CELLS = 5_000_000  # largest number of cells of a table whose rows are held as Python objects

CHUNK = 4096  # rows of which all columns are copied together

BUFFER = 2**16  # size in which a column is read [bytes]; without it pyarrow holds whole row groups


class ParquetLog:
    """An open Parquet file."""

    def __init__(self, path: Path) -> None:
        self.name = path.name
        pq = imported("pyarrow.parquet", "Parquet")
        size = path.stat().st_size
        with undamaged(self.name, KIND):
            self._file = pq.ParquetFile(path, pre_buffer=False, buffer_size=BUFFER)
            self.rows = int(self._file.metadata.num_rows)
            self.columns = tuple(self._file.schema_arrow.names)
        if self.rows < 1:
            raise RecordingError(f"{self.name} holds no rows; export the log again")
        if 8 * self.rows * len(self.columns) > EXPANSION * size + SLACK:
            raise RecordingError(
                f"{self.name} states {self.rows} rows in {size} bytes, beyond the "
                "decompression limit; it is damaged, so export it again"
            )
        meta = self._file.metadata
        counts = (meta.row_group(i).num_rows for i in range(meta.num_row_groups))
        self._starts = np.cumsum([0, *counts])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def group_start(self, row: int) -> int:
        """First row of the row group that holds a row: decoding can only begin there."""
        return int(self._starts[np.searchsorted(self._starts, row, side="right") - 1])

    def table(self, columns: tuple[str, ...]) -> LogTable:
        """All rows of some columns, side by side; lists give several numbers each."""
        values = self.joined([self.blocks(batch, columns) for batch in self.batches(columns)])
        if len(values) != self.rows:
            raise self._other_rows()
        return LogTable(values, np.arange(self.rows, dtype=np.int64))

    def joined(self, parts: list[list[Array]], by_columns: bool = False) -> Array:
        """Columns side by side and batches below each other; every number is copied once."""
        widths = [block.shape[1] for block in parts[0]]
        shape = sum(len(blocks[0]) for blocks in parts), sum(widths)
        by_columns = by_columns and max(widths) == 1
        # Row by row, some rows of all columns are copied together: what is written stays in the
        # cache.
        step = max(shape) if by_columns else CHUNK
        values, at = np.empty(shape, order="F" if by_columns else "C"), 0
        for blocks in parts:
            if [block.shape[1] for block in blocks] != widths:
                raise self._other_rows()
            for first in range(0, len(blocks[0]), step):
                last, column = min(first + step, len(blocks[0])), 0
                for block, width in zip(blocks, widths, strict=True):
                    values[at + first : at + last, column : column + width] = block[first:last]
                    column += width
            at += len(blocks[0])
        values.setflags(write=not by_columns)
        return values

    def _other_rows(self) -> RecordingError:
        return RecordingError(
            f"{self.name} is expected to have {self.rows} rows of one width, but its pages "
            "hold others; export the log again"
        )

    def batches(self, columns: tuple[str, ...], first_row: int = 0) -> Iterator[Any]:
        """Yield batches of rows, beginning with the first row of a row group."""
        self._require(columns)
        with undamaged(self.name, KIND):
            groups = range(int(np.searchsorted(self._starts, first_row)), len(self._starts) - 1)
            yield from self._file.iter_batches(
                BATCH,
                row_groups=list(groups),
                columns=list(dict.fromkeys(columns)),
                use_threads=False,
            )

    def blocks(self, batch: Any, columns: tuple[str, ...]) -> list[Array]:
        """Numbers (N, m) of every column of a batch, m = 1 where it holds no lists; null is NaN."""
        with undamaged(self.name, KIND):
            return [self._block(batch.column(column), column) for column in columns]

    def _block(self, cells: Any, column: str) -> Array:
        if not _is_list(cells.type):
            return _floats(cells).reshape(-1, 1)
        compute = imported("pyarrow.compute", "Parquet")
        widths = compute.unique(compute.list_value_length(cells)).to_pylist()
        if len(widths) != 1 or not widths[0]:  # None of a cell without a list
            raise RecordingError(
                f"{self.name}: the lists of the column {column!r} are expected to be of one "
                "length above 0, but are not; write one number per joint and instant"
            )
        return _floats(cells.flatten()).reshape(len(cells), widths[0])

    def first_cells(self, lists: bool = False) -> dict[str, list[Any]]:
        """First cells of every column, of those of lists too if requested."""
        with undamaged(self.name, KIND):
            kinds = zip(self.columns, self._file.schema_arrow.types, strict=True)
            names = [name for name, kind in kinds if lists or not _is_list(kind)]
            for batch in self._file.iter_batches(HEAD, columns=names, use_threads=False):
                return dict(zip(names, (batch.column(k).to_pylist() for k in names), strict=True))
        raise self._other_rows()

    def _require(self, columns: tuple[str, ...]) -> None:
        missing = [column for column in columns if column not in self.columns]
        twice = [column for column in columns if self.columns.count(column) > 1]
        if twice:
            raise RecordingError(
                f"{self.name} has several columns called {twice[0]!r}; give each a different name"
            )
        if missing:
            raise RecordingError(
                f"{self.name} is expected to have the columns {', '.join(columns)}, but "
                f"{', '.join(missing[:4])} {'is' if len(missing) == 1 else 'are'} missing; "
                "rename the columns or describe them in a recipe"
            )
        types = imported("pyarrow.types", "Parquet")
        for column in columns:
            kind = self._file.schema_arrow.field(column).type
            inner = kind.value_type if _is_list(kind) else kind
            if not (types.is_floating(inner) or types.is_integer(inner)):
                raise RecordingError(
                    f"{self.name}: the column {column!r} is expected to hold real numbers, "
                    f"but is of type {kind}; convert it to double"
                )


def rows_of(path: Path) -> tuple[dict[bytes, bytes], list[dict[str, Any]]]:
    """Metadata of a small table, and its rows."""
    pq = imported("pyarrow.parquet", "Parquet")
    with (
        undamaged(path.name, KIND),
        pq.ParquetFile(require_file(path), page_checksum_verification=True) as file,
    ):
        cells = file.metadata.num_rows * file.metadata.num_columns
        if cells > MOST_CELLS:
            raise RecordingError(f"{path.name} states {cells} cells, more than {MOST_CELLS}")
        table = file.read(use_threads=False)
        return dict(table.schema.metadata or {}), table.to_pylist()


def _write(recording: Recording, file: IO[bytes]) -> None:
    pa = imported("pyarrow", "Parquet")
    pq = imported("pyarrow.parquet", "Parquet")
    pq.write_table(pa.table(recording.columns_of_frame()), file)


def parquet_columns(columns: Columns, key: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that a recipe means: by name, by index, or one column of lists by its key."""
    if columns and columns != ("",):
        if any(isinstance(c, int) and not 0 <= c < len(names) for c in columns):
            raise RecordingError(
                f"the recipe names a column beyond the {len(names)} of the file; correct it"
            )
        return tuple(names[c] if isinstance(c, int) else c for c in columns)
    if key:
        return (key,)
    raise RecordingError("the recipe names no columns of a Parquet file; write columns = [...]")


def _floats(cells: Any) -> Array:
    """Numbers as float64; null is NaN."""
    # Stamps in ns are beyond 2^53, which a safe cast refuses.
    cells = cells.cast("float64", safe=False)
    return np.asarray(cells.to_numpy(zero_copy_only=False), dtype=np.float64)


def _is_list(kind: Any) -> bool:
    types = imported("pyarrow.types", "Parquet")
    return bool(types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind))


class ParquetRows:
    """Columns of a Parquet file; reading forwards costs one pass, going back begins anew."""

    def __init__(self, log: ParquetLog, kinds: Mapping[str, tuple[str, ...]]) -> None:
        self._log, self._kinds = log, dict(kinds)
        self._columns = tuple(column for columns in self._kinds.values() for column in columns)
        self.count = log.rows
        self._held: deque[Any] = deque()
        self._first = self._next = 0
        self._batches = log.batches(self._columns, 0)

    def read(self, start: int, stop: int) -> dict[str, Array]:
        """Rows start … stop of every kind of signal."""
        group = self._log.group_start(start)
        if start < self._first or group > self._next:
            self._held.clear()
            self._first = self._next = group
            self._batches = self._log.batches(self._columns, group)
        self._forget(start)
        while self._next < stop:
            batch = next(self._batches, None)
            if batch is None:
                raise RecordingError(f"{self._log.name} holds fewer rows than it states")
            self._held.append(batch)
            self._next += batch.num_rows
            self._forget(start)
        parts, at = [], self._first
        for batch in self._held:
            if at < stop:
                first = max(start - at, 0)
                parts.append(batch.slice(first, stop - at - first))
            at += batch.num_rows
        return {
            kind: self._log.joined([self._log.blocks(p, columns) for p in parts], by_columns=True)
            for kind, columns in self._kinds.items()
        }

    def _forget(self, start: int) -> None:
        while self._held and self._first + self._held[0].num_rows <= start:
            self._first += self._held.popleft().num_rows


class ParquetReader(LogReader):
    """Reader of a Parquet file."""

    def convention(self) -> Recipe:
        """Recipe of the columns t, q1 …, or t and q with lists."""
        with closing(ParquetLog(self.raw.hashed())) as log:
            titles = log.columns
        if "q" in titles:
            return default_convention.arrays_convention(titles, "parquet")
        if "q1" not in titles:
            raise RecordingError(
                f"{self.raw.name} is expected to have the columns t, q1 … qn (or t and q with "
                f"lists), but has {', '.join(titles[:8]) or 'none'}; rename them or describe them "
                "in a recipe"
            )
        self.said = default_convention.unread_columns(titles, self.raw.name)
        return default_convention.columns_convention(list(titles), "parquet", self.raw.name)

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Columns that a part of the recipe names."""
        with closing(ParquetLog(self.raw.hashed())) as log:
            return log.table(parquet_columns(part.columns, part.key, log.columns))

    def head(self) -> list[list[str]]:
        """Titles and the first rows of columns without lists."""
        with closing(ParquetLog(self.raw.hashed())) as log:
            cells = log.first_cells()
        rows = zip(*(values for values in cells.values()), strict=True)
        return [list(cells), *([str(cell) for cell in row] for row in rows)]

    def arrays(self) -> dict[str, tuple[int, ...]]:
        """Columns of lists, and the others beside them."""
        with closing(ParquetLog(self.raw.hashed())) as log:
            cells, count = log.first_cells(lists=True), log.rows
        shapes: dict[str, tuple[int, ...]] = {
            name: (count, len(values[0])) if isinstance(values[0], list) else (count,)
            for name, values in cells.items()
        }
        return shapes if any(len(shape) > 1 for shape in shapes.values()) else {}

    def rows(self, parts: Mapping[str, Signal | Time]) -> LogRows:
        """Rows of the columns, decoded batch by batch."""
        log = ParquetLog(self.raw.hashed())
        return ParquetRows(
            log,
            {
                kind: parquet_columns(part.columns, part.key, log.columns)
                for kind, part in parts.items()
            },
        )


PARQUET = LogFormat(
    name="parquet",
    sentence="Parquet with one column per joint and signal, or one column of lists per signal",
    suffixes=(".parquet",),
    reader=ParquetReader,
    write=_write,
    has_titles=True,
    reads_time_alone=True,
)
