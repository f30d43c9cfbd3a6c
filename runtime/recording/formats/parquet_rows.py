"""Rows of a Parquet file that stays where it is, decoded batch by batch."""

from collections import deque
from collections.abc import Mapping

from runtime.errors import RecordingError
from runtime.recording.formats.parquet import Batch, ParquetLog
from runtime.recording.formats.tables import FloatArray


class ParquetRows:
    """Columns of a Parquet file; reading forwards costs one pass, going back begins anew."""

    def __init__(self, log: ParquetLog, kinds: Mapping[str, tuple[str, ...]]) -> None:
        self._log, self._kinds = log, dict(kinds)
        self._columns = tuple(column for columns in self._kinds.values() for column in columns)
        self.count = log.rows
        self._held: deque[Batch] = deque()
        self._first = self._next = 0
        self._batches = log.batches(self._columns, 0)

    def read(self, start: int, stop: int) -> dict[str, FloatArray]:
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
            self._next += len(batch)
            self._forget(start)
        parts, at = [], self._first
        for batch in self._held:
            if at < stop:
                parts.append(batch.rows(max(start - at, 0), min(stop - at, len(batch))))
            at += len(batch)
        return {
            kind: self._log.joined([part.blocks(columns) for part in parts], by_columns=True)
            for kind, columns in self._kinds.items()
        }

    def _forget(self, start: int) -> None:
        while self._held and self._first + len(self._held[0]) <= start:
            self._first += len(self._held.popleft())
