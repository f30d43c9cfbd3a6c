"""Finished trials on disk: chunks/00000-00024.parquet, each complete or absent.

A chunk has the hash of its config and checksums of its pages. A chunk that is truncated, altered or
of another config is reported and computed again.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from runtime.common.files import replacing
from runtime.errors import RecordingError, RuntimeFault
from runtime.experiments.study import Row
from runtime.recording.formats.parquet_format import rows_of

NAME = "run.lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder within the block; the operating system drops the lock of a killed process."""
    path = folder / NAME
    lock = FileLock(path, blocking=False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout:
        holder = path.read_text(encoding="utf-8", errors="replace")[:20].strip() or "unknown"
        raise RuntimeFault(
            f"process {holder} is using '{folder}'; wait for it, or choose another place with --out"
        ) from None
    except OSError as error:
        raise RuntimeFault(
            f"cannot write '{folder}' ({error.strerror}); choose another place with --out"
        ) from None
    with lock:
        with suppress(OSError):  # the process id is optional, and the disk may be full
            path.write_text(f"{os.getpid()}\n", encoding="utf-8")
        yield


HASH = b"config_hash"
_TEXT, _WHOLE, _CLAIM, _LIST = ("case", "method", "status"), ("trial",), ("consistent",), ("curve",)


def arrow() -> Any:
    """Import pyarrow and its Parquet module."""
    try:
        import_module("pyarrow.parquet")
        return import_module("pyarrow")
    except ImportError:
        raise RuntimeFault(
            "trials of experiments are Parquet files, which need pyarrow; install it with: "
            "pip install 'symgen[experiments]'"
        ) from None


def write_rows(rows: list[Row], path: Path, mark: str) -> None:
    """Write rows as Parquet, with columns in the order of their first appearance."""
    pa = arrow()
    names = list(dict.fromkeys(name for row in rows for name in row))
    fields = [pa.field(name, _type(pa, name)) for name in names]
    schema = pa.schema(fields, metadata={HASH: mark.encode()})
    table = pa.Table.from_pylist(rows, schema=schema)
    with replacing(path) as file:
        pa.parquet.write_table(table, file, write_page_checksum=True)


def read_rows(path: Path, mark: str) -> list[Row] | None:
    """Read rows of a file."""
    arrow()
    try:
        metadata, rows = rows_of(path)
    except RecordingError:
        return None
    if metadata.get(HASH, b"").decode(errors="replace") != mark:
        return None
    return [{k: v for k, v in row.items() if v is not None} for row in rows]


def _type(pa: Any, name: str) -> Any:
    if name in _TEXT:
        return pa.string()
    if name in _WHOLE:
        return pa.int64()
    if name in _CLAIM:
        return pa.bool_()
    return pa.list_(pa.float64()) if name in _LIST else pa.float64()


class Chunks:
    """Chunks in the folder of one study."""

    def __init__(self, folder: Path, mark: str, notify: Callable[[str], None]) -> None:
        """Take the hash of the study's config; `notify` gets a sentence on each unusable chunk."""
        self._folder, self._mark, self._notify = folder / "chunks", mark, notify

    def read(self, trials: int) -> dict[int, list[Row]]:
        """Rows of the finished trials below `trials`; the first file of a trial counts."""
        rows_by_trial: dict[int, list[Row]] = {}
        for path in sorted(self._folder.glob("*.parquet")):
            rows, numbers = read_rows(path, self._mark), _numbers(path)
            if rows is None or {row["trial"] for row in rows} != set(numbers):
                self._notify(
                    f"'{path}' is damaged or of another config; its trials are computed again"
                )
                continue
            new = {number for number in numbers if number < trials and number not in rows_by_trial}
            for row in rows:
                if row["trial"] in new:
                    rows_by_trial.setdefault(row["trial"], []).append(row)
        return rows_by_trial

    def sweep(self) -> None:
        """Remove unfinished files of a killed run. The caller must hold the lock."""
        for draft in self._folder.glob(".*"):
            draft.unlink(missing_ok=True)

    def write(self, numbers: range, rows: list[Row]) -> None:
        """Write one finished chunk."""
        name = f"{numbers.start:05d}-{numbers.stop - 1:05d}.parquet"
        write_rows(rows, self._folder / name, self._mark)


def missing(done: Iterable[int], trials: int, size: int) -> list[range]:
    """Consecutive ranges of trials that are not done."""
    have, runs = set(done), list[range]()
    for number in range(trials):
        if number in have:
            continue
        if runs and runs[-1].stop == number and len(runs[-1]) < size and number % size:
            runs[-1] = range(runs[-1].start, number + 1)
        else:
            runs.append(range(number, number + 1))
    return runs


def _numbers(path: Path) -> range:
    """Numbers of the trials in the name of a file; empty for other names."""
    first, _, last = path.stem.partition("-")
    if not (first.isdigit() and last.isdigit()):
        return range(0)
    return range(int(first), int(last) + 1)
