"""Compute a study chunk by chunk, here or on a cluster, continuing an earlier run; its state.

Every finished chunk is a file; result.json is written last. A run that was killed leaves chunks,
from which the next run continues; damaged files are computed again.
"""

from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from runtime.common.files import json_of, write_json
from runtime.common.threads import cores, one_blas_thread
from runtime.errors import RuntimeFault
from runtime.experiments import storage
from runtime.experiments.studies import STUDIES
from runtime.experiments.study import Arrays, Row, Study, StudyConfig, config_facts, config_hash
from runtime.library import Library, load
from runtime.parallel import on_cluster

MISSING, PARTIAL, DONE, DIFFERS = "missing", "partial", "done", "hash differs"

DEFAULT_TRIALS = 150  # number of Monte Carlo trials of the document


@dataclass(frozen=True, slots=True)
class Request:
    """Options of a run."""

    out: Path  # folder of all studies
    trials: int = DEFAULT_TRIALS  # number of trials of studies that do not fix it
    seed: int | None = None  # of the trials; None for the default of each study
    scheduler: str | None = None  # address of a dask cluster; None computes on this machine
    threads: int | None = None  # on this machine; None: one per core. Rows do not depend on it
    fresh: bool = False  # remove earlier trials of the study
    command: str = ""  # command line, for the provenance
    # called with the name of the study, finished trials, and all trials
    progress: Callable[[str, int, int], None] = lambda *_: None
    notify: Callable[[str], None] = lambda _: None  # called with sentences on damaged files


@one_blas_thread
def reproduce(lib: Library, study: Study, request: Request) -> dict[str, Any]:
    """Compute the missing trials of a study and of the studies that it needs.

    Args:
        lib: the robot.
        study: to be computed.
        request: output folder, seed, number of trials and workers.

    Returns:
        Content of result.json.

    Raises:
        RuntimeFault: the folder has trials of another config, is in use, or cannot be written,
            or a trial cannot be computed.
        KeyboardInterrupt: finished chunks are kept.
    """
    storage.arrow()
    needed: Arrays = {}
    for name in study.needs:
        reproduce(lib, STUDIES[name], replace(request, fresh=False))
        needed = {**needed, **storage.read_series(request.out / name)}
    config, trials = requested(study, request)
    facts = config_facts(study, config, lib)
    mark = config_hash(facts, lib.manifest.model_hash, needed)
    folder = request.out / study.name
    with storage.locked(folder):
        if request.fresh:
            _clear(folder)
        known = storage.valid_result(folder, mark)
        if known is not None and known["trials"] == trials:
            request.progress(study.name, trials, trials)
            return known
        _claim(folder, facts, mark, trials, request)
        if known is None and (folder / storage.RESULT).exists():
            damaged = folder / storage.RESULT
            request.notify(f"'{damaged}' is damaged; it is written again from the trials")
        chunks = storage.Chunks(folder, mark, request.notify)
        chunks.sweep()
        done = chunks.read(trials)
        request.progress(study.name, len(done), trials)
        prepared = study.prepare(lib, config, needed)
        runs = storage.missing(done, trials, study.per_chunk)
        computed: Generator[tuple[range, list[Row]], None, None]
        if request.scheduler is not None and runs:
            place = lib.folder.resolve(), lib.level
            prepare = partial(_prepared, study.name, place, config, dict(needed))
            what = f"a chunk of '{study.name}'"
            computed = on_cluster(prepare, _rows, [runs], request.scheduler, what)
        else:
            threads = request.threads or cores()
            computed = ((numbers, study.run(prepared, numbers, threads)) for numbers in runs)
        with closing(computed):
            for numbers, rows in computed:
                chunks.write(numbers, rows)
                for row in rows:
                    done.setdefault(row["trial"], []).append(row)
                request.progress(study.name, len(done), trials)
        rows = [row for number in sorted(done) for row in done[number]]
        end = study.finish(prepared, rows)
        return storage.write_outcome(
            study, folder, lib, facts, mark, trials, rows, end, request.command
        )


def requested(study: Study, request: Request) -> tuple[StudyConfig, int]:
    """Config and number of trials of a request."""
    trials = request.trials if study.trials is None else study.trials
    if trials < 1:
        raise RuntimeFault(f"expected at least one trial, got {trials}; give a larger --trials")
    config = study.config
    if request.seed is not None and study.takes_seed:
        config = replace(config, seed=request.seed)  # type: ignore[type-var]
    return config, trials


def _claim(
    folder: Path, facts: Mapping[str, Any], mark: str, trials: int, request: Request
) -> None:
    """Write config.json."""
    path = folder / storage.CONFIG
    existing = folder_hash(folder)
    if existing is not None and existing != mark:
        raise RuntimeFault(
            f"'{folder}' holds trials of another config (hash {existing[:12]}, requested: "
            f"{mark[:12]}); replace them with --fresh, or choose another place with --out"
        )
    if existing is None and path.exists():
        request.notify(f"'{path}' is damaged; it is written again")
    write_json(path, {"config_hash": mark, "trials": trials, "config": dict(facts)})


def folder_hash(folder: Path) -> str | None:
    """Config hash of the folder of a study; None where it cannot be read."""
    try:
        return str(json_of(folder / storage.CONFIG)["config_hash"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _clear(folder: Path) -> None:
    """Remove the files of a study, and no others."""
    names = storage.RESULT, storage.TRIALS, storage.SERIES, storage.CONFIG
    for path in [*(folder / name for name in names), *(folder / "chunks").glob("*")]:
        path.unlink(missing_ok=True)


def _prepared(
    name: str, place: tuple[Path, str], config: StudyConfig, needed: Arrays
) -> tuple[Study, Any]:
    """A study, by its name, and its input: on a worker, which imports its functions."""
    study = STUDIES[name]
    return study, study.prepare(load(*place), config, needed)


def _rows(prepared: tuple[Study, Any], numbers: range) -> tuple[range, list[Row]]:
    study, known = prepared
    return numbers, study.run(known, numbers, 1)


@dataclass(frozen=True, slots=True)
class State:
    """State of one study in one folder."""

    word: str  # missing, partial, done or hash differs
    done: int  # number of finished trials
    trials: int  # number of requested trials

    def __str__(self) -> str:
        if self.word in {MISSING, DIFFERS}:
            return self.word
        return f"{self.word} ({self.done} of {self.trials} trials)"


def state_of(lib: Library, study: Study, request: Request) -> State:
    """State of a study without computing anything.

    Args:
        lib: the robot.
        study: of which the folder is read.
        request: output folder, seed and number of trials.

    Returns:
        The state.
    """
    folder = request.out / study.name
    config, trials = requested(study, request)
    existing = folder_hash(folder)
    if existing is None:
        return State(MISSING, 0, trials)
    needed: Arrays = {}
    for name in study.needs:
        if storage.valid_result(request.out / name) is None:
            return State(DIFFERS, 0, trials)
        needed = {**needed, **storage.read_series(request.out / name)}
    mark = config_hash(config_facts(study, config, lib), lib.manifest.model_hash, needed)
    if existing != mark:
        return State(DIFFERS, 0, trials)
    result = storage.valid_result(folder, mark)
    if result is not None and result["trials"] == trials:
        return State(DONE, trials, trials)
    done = len(storage.Chunks(folder, mark, lambda _: None).read(trials))
    return State(PARTIAL, done, trials)
