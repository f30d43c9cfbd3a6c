"""Trials of a study on the workers of a dask cluster."""

import threading
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from runtime.experiments.study import Arrays, Row, Study, StudyConfig
from runtime.library import Library, load
from runtime.parallel import on_cluster

_here = threading.local()
"""Last prepared input of a thread of a worker, with its key."""


@dataclass(frozen=True, slots=True)
class Sent:
    """Message to a worker, which imports the functions of the study by its name."""

    study: str
    config: StudyConfig
    needed: Arrays
    folder: Path
    level: str


def on_workers(
    study: Study,
    lib: Library,
    config: StudyConfig,
    needed: Arrays,
    runs: Sequence[range],
    scheduler: str,
) -> Generator[tuple[range, list[Row]], None, None]:
    """Compute ranges of trials on a dask cluster."""
    sent = Sent(study.name, config, dict(needed), lib.folder.resolve(), lib.level)
    return on_cluster(_rows, sent, [runs], scheduler, f"a chunk of '{study.name}'")


def _rows(sent: Sent, key: str, numbers: range) -> tuple[range, list[Row]]:
    from runtime.experiments.studies_by_name import STUDIES

    study = STUDIES[sent.study]
    known: tuple[str, Any] | None = getattr(_here, "prepared", None)
    if known is None or known[0] != key:
        threadpool_limits(limits=1, user_api="blas")
        lib = load(sent.folder, sent.level)
        known = _here.prepared = key, study.prepare(lib, sent.config, sent.needed)
    return numbers, study.run(known[1], numbers, 1)
