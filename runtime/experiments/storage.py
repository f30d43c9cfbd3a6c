"""Finished trials and results on disk: chunks/00000-00024.parquet, each complete or absent.

A chunk has the hash of its config and checksums of its pages. A chunk that is truncated, altered or
of another config is reported and computed again. All rows of a study become trials.parquet,
series.npz and, last, result.json with their SHA-256.
"""

import os
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from runtime.common.files import json_of, replacing, sha256_of, write_json
from runtime.errors import RecordingError, RuntimeFault
from runtime.experiments.study import FORMAT, Row, Study, StudyOutcome
from runtime.library import Array, Library
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
    kinds = dict.fromkeys(("case", "method", "status"), pa.string()) | {
        "trial": pa.int64(),
        "consistent": pa.bool_(),
        "curve": pa.list_(pa.float64()),
    }
    fields = [pa.field(name, kinds.get(name, pa.float64())) for name in names]
    table = pa.Table.from_pylist(rows, schema=pa.schema(fields, metadata={HASH: mark.encode()}))
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


_FILE = Path(__file__).with_name("document_numbers.toml")


def document_values(ids: Iterable[str]) -> list[dict[str, Any]]:
    """Entries {id, source, case, method, metric, mean, std[, misprint]} of the ids with numbers."""
    tables = tomllib.loads(_FILE.read_text(encoding="utf-8"))
    lines = []
    for name in dict.fromkeys(ids):
        table = tables.get(name, {})
        for entry in table.get("entries", ()):
            kept = {key: entry[key] for key in ("case", "method")}
            for metric, value in entry.items():
                if metric in kept or metric == "misprints":
                    continue
                for label, mean, std in _pairs(metric, value):
                    line = {"metric": label, "mean": mean, "std": std}
                    misprint = entry.get("misprints", {}).get(label)
                    line |= {} if misprint is None else {"misprint": misprint}
                    lines.append({"id": name, "source": table["source"], **kept, **line})
    return lines


def _pairs(metric: str, value: Any) -> list[tuple[str, float, float | None]]:
    """A number, [mean, std], or one of those per joint."""
    if not isinstance(value, list):
        return [(metric, float(value), None)]
    if value and isinstance(value[0], list):
        return [
            (f"{metric}_{joint}", float(pair[0]), float(pair[1]) if len(pair) > 1 else None)
            for joint, pair in enumerate(value, start=1)
        ]
    return [(metric, float(value[0]), float(value[1]))]


RESULT, TRIALS, SERIES, CONFIG = "result.json", "trials.parquet", "series.npz", "config.json"
QUARTILES = (0.25, 0.5, 0.75)
_NO_FIGURE = ("case", "method", "trial", "status", "curve")


def write_outcome(
    study: Study,
    folder: Path,
    lib: Library,
    config: Mapping[str, Any],
    mark: str,
    trials: int,
    rows: Sequence[Row],
    finished: StudyOutcome,
    command: str,
) -> dict[str, Any]:
    """Write trials.parquet, series.npz and result.json."""
    flat = [{k: v for k, v in row.items() if k != "curve"} for row in [*rows, *finished.rows]]
    write_rows(flat, folder / TRIALS, mark)
    with replacing(folder / SERIES) as file:
        np.savez_compressed(file, **finished.series)  # type: ignore[arg-type]
    facts = {
        "format": FORMAT,
        "study": study.name,
        "title": study.title,
        "config": dict(config),
        "config_hash": mark,
        "trials": trials,
        "robot": lib.name,
        "joints": list(lib.joint_names),
        "model_hash": lib.manifest.model_hash,
        "versions": lib.versions,
        "command": command,
        "files": {name: sha256_of(folder / name) for name in (TRIALS, SERIES)},
        "cases": dict(study.cases),
        "methods": dict(study.methods),
        "views": [asdict(view) for view in study.views],
        "facts": finished.facts,
        "summary": summary(flat),
        "document": document_values([v.document or v.id for v in study.views]),
    }
    write_json(folder / RESULT, facts)
    return facts


def summary(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Mean, standard deviation (n − 1) and count of every metric, case and method."""
    values: dict[tuple[str, str, str], list[float]] = {}
    for row in rows:
        for name, value in row.items():
            if name not in _NO_FIGURE:
                values.setdefault((row["case"], row["method"], name), []).append(float(value))
    return [
        {
            "case": case,
            "method": method,
            "metric": metric,
            "mean": float(np.mean(numbers)),
            "std": float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None,
            "n": len(numbers),
            "quartiles": np.quantile(numbers, QUARTILES).tolist(),
        }
        for (case, method, metric), numbers in values.items()
    ]


def valid_result(folder: Path, mark: str | None = None) -> dict[str, Any] | None:
    """Content of result.json where it matches its files.

    Args:
        folder: of a study.
        mark: expected config hash; None for any.

    Returns:
        The content; None where a file is missing, damaged or of another hash.
    """
    try:
        facts = json_of(folder / RESULT)
        whole = all(sha256_of(folder / name) == digest for name, digest in facts["files"].items())
        right = facts["format"] == FORMAT and mark in {None, facts["config_hash"]}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return dict(facts) if whole and right else None


def read_series(folder: Path) -> dict[str, Array]:
    """Series of a study, after `valid_result` has checked them."""
    with np.load(folder / SERIES) as file:
        return {name: file[name] for name in file.files}
