"""Run a study chunk by chunk, on from wherever the last run ended.

Every finished chunk is a file; result.json comes last. A kill between any two steps leaves chunks
that the next run takes up; a file that is not whole is computed again.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from runtime.errors import RuntimeFault
from runtime.experiments.storage.chunks import Chunks, arrow, missing
from runtime.experiments.storage.lock import locked
from runtime.experiments.storage.result_files import (
    CONFIG,
    RESULT,
    SERIES,
    TRIALS,
    read_series,
    valid_result,
    write_json,
    write_outcome,
)
from runtime.experiments.studies_by_name import STUDIES
from runtime.experiments.study import Arrays, Row, Study, StudyConfig, config_facts, config_hash
from runtime.experiments.workers import on_workers
from runtime.files import json_of
from runtime.library import Library
from runtime.parallel import cores, one_blas_thread

DEFAULT_TRIALS = 150
"""Of the document."""


@dataclass(frozen=True, slots=True)
class Request:
    """How to run.

    Attributes:
        out: folder of all studies.
        trials: of the studies that do not fix their number.
        seed: None is each study's own.
        scheduler: of a dask cluster; None computes here.
        threads: here; None is one per core. The rows do not depend on it.
        fresh: throw earlier trials of the study away.
        command: for the provenance.
        progress: called with the study's name, how many trials are done, and of how many.
        notify: called with sentences.
    """

    out: Path
    trials: int = DEFAULT_TRIALS
    seed: int | None = None
    scheduler: str | None = None
    threads: int | None = None
    fresh: bool = False
    command: str = ""
    progress: Callable[[str, int, int], None] = lambda *_: None
    notify: Callable[[str], None] = lambda _: None


@one_blas_thread
def reproduce(lib: Library, study: Study, request: Request) -> dict[str, Any]:
    """Compute what is missing of a study and of those it needs; what result.json says.

    Raises:
        RuntimeFault: the folder holds another config's trials or is in use, cannot be written,
            or a trial cannot be computed.
        KeyboardInterrupt: finished chunks are kept.
    """
    arrow()
    needed: Arrays = {}
    for name in study.needs:
        reproduce(lib, STUDIES[name], replace(request, fresh=False))
        needed = {**needed, **read_series(request.out / name)}
    config, trials = requested(study, request)
    facts = config_facts(study, config, lib)
    mark = config_hash(facts, lib.manifest.model_hash, needed)
    folder = request.out / study.name
    with locked(folder):
        if request.fresh:
            _clear(folder)
        known = valid_result(folder, mark)
        if known is not None and known["trials"] == trials:
            request.progress(study.name, trials, trials)
            return known
        _claim(folder, facts, mark, trials, request)
        if known is None and (folder / RESULT).exists():
            request.notify(f"'{folder / RESULT}' is not whole; it is made again from the trials")
        chunks = Chunks(folder, mark, request.notify)
        chunks.sweep()
        done = chunks.read(trials)
        request.progress(study.name, len(done), trials)
        prepared = study.prepare(lib, config, needed)
        runs = missing(done, trials, study.per_chunk)
        with closing(_computed(study, lib, config, needed, prepared, runs, request)) as computed:
            for numbers, rows in computed:
                chunks.write(numbers, rows)
                for row in rows:
                    done.setdefault(row["trial"], []).append(row)
                request.progress(study.name, len(done), trials)
        rows = [row for number in sorted(done) for row in done[number]]
        end = study.finish(prepared, rows)
        return write_outcome(study, folder, lib, facts, mark, trials, rows, end, request.command)


def requested(study: Study, request: Request) -> tuple[StudyConfig, int]:
    """StudyConfig and number of trials.

    Raises:
        RuntimeFault: no trials.
    """
    trials = request.trials if study.trials is None else study.trials
    if trials < 1:
        raise RuntimeFault(f"expected at least one trial, got {trials}; give a larger --trials")
    config = study.config
    if request.seed is not None and study.takes_seed:
        config = replace(config, seed=request.seed)  # type: ignore[type-var]
    return config, trials


def _computed(
    study: Study,
    lib: Library,
    config: StudyConfig,
    needed: Arrays,
    prepared: Any,
    runs: Sequence[range],
    request: Request,
) -> Generator[tuple[range, list[Row]], None, None]:
    if request.scheduler is not None and runs:
        return on_workers(study, lib, config, needed, runs, request.scheduler)
    threads = request.threads or cores()
    return ((numbers, study.run(prepared, numbers, threads)) for numbers in runs)


def _claim(
    folder: Path, facts: Mapping[str, Any], mark: str, trials: int, request: Request
) -> None:
    """Write config.json, unless the folder is of another config.

    Raises:
        RuntimeFault: it is.
    """
    path = folder / CONFIG
    existing = folder_hash(folder)
    if existing is not None and existing != mark:
        raise RuntimeFault(
            f"'{folder}' holds trials of another config (hash {existing[:12]}, asked for is "
            f"{mark[:12]}); replace them with --fresh, or choose another place with --out"
        )
    if existing is None and path.exists():
        request.notify(f"'{path}' is not whole; it is written again")
    write_json(path, {"config_hash": mark, "trials": trials, "config": dict(facts)})


def folder_hash(folder: Path) -> str | None:
    """Hash of the config that a study's folder is of; None where nothing tells."""
    try:
        return str(json_of(folder / CONFIG)["config_hash"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _clear(folder: Path) -> None:
    """Remove what this package writes, and nothing else."""
    files = [folder / name for name in (RESULT, TRIALS, SERIES, CONFIG)]
    for path in [*files, *(folder / "chunks").glob("*")]:
        path.unlink(missing_ok=True)
