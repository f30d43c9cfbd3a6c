"""Log format Parquet: columns as in a CSV, or as in an NPZ with lists of n numbers."""

from collections.abc import Mapping
from contextlib import closing
from typing import IO, Any

from runtime.errors import RecordingError
from runtime.recording.formats.log_format import LogFormat, LogReader, Rows
from runtime.recording.formats.parquet import (
    ParquetLog,
    parquet_columns,
    write_parquet,
)
from runtime.recording.formats.parquet_rows import ParquetRows
from runtime.recording.formats.tables import LogTable
from runtime.recording.recipes.default_convention import KINDS, UNITS, columns_convention
from runtime.recording.recipes.recipe import Recipe, Signal, Time
from runtime.recording.recipes.unread_signals import unread_columns
from runtime.recording.recording import Recording


class ParquetReader(LogReader):
    """Reader of a Parquet file."""

    def convention(self) -> Recipe:
        """Recipe of the columns t, q1 …, or t and q with lists."""
        with closing(ParquetLog(self.raw.hashed())) as log:
            titles = log.columns
        if "q" in titles:
            keys = {key: key for key in UNITS if key in titles}
            signals: dict[str, Any] = {
                KINDS[key]: Signal(unit=UNITS[key], layout="parquet", key=key) for key in keys
            }
            return Recipe(time=Time(column="t", unit="s", layout="parquet"), **signals)
        if "q1" not in titles:
            raise RecordingError(
                f"{self.raw.name} is expected to have the columns t, q1 … qn (or t and q with "
                f"lists), but has {', '.join(titles[:8]) or 'none'}; rename them or describe them "
                "in a recipe"
            )
        self.said = unread_columns(titles, self.raw.name)
        return columns_convention(list(titles), "parquet", self.raw.name)

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Columns that a part of the recipe names."""
        del kind
        with closing(ParquetLog(self.raw.hashed())) as log:
            return log.table(parquet_columns(part.columns, part.key, log.columns))

    def rows(self, parts: Mapping[str, Signal | Time]) -> Rows:
        """Rows of the columns, decoded batch by batch."""
        log = ParquetLog(self.raw.hashed())
        return ParquetRows(
            log,
            {
                kind: parquet_columns(part.columns, part.key, log.columns)
                for kind, part in parts.items()
            },
        )


def _write(recording: Recording, file: IO[bytes]) -> None:
    write_parquet(*recording.titled(), file)


PARQUET = LogFormat(
    name="parquet",
    sentence="Parquet with one column per joint and signal, or one column of lists per signal",
    suffixes=(".parquet",),
    reader=ParquetReader,
    write=_write,
    reads_time_alone=True,
)
