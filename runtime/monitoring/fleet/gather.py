"""Statistics files of a folder → the units of a fleet, here or on a dask cluster.

Friction is eliminated, so that A β = b + ε with ε ~ N(0, 1) is what a unit contributes to the
inertias of the type. Its friction follows from β:  φ = f − G β + N(0, v).

The files are read in parts of `PART`. Each finished part is one file in the folder OUT.parts, named
by the files that it was computed from, so that a run that was killed continues with the parts that
are missing. The folder is removed when the prior is written.
"""

import hashlib
import zipfile
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from runtime.common.files import bytes_of, replacing
from runtime.common.threads import cores
from runtime.errors import IdentificationError
from runtime.estimators.contradictions import LEAST_DENSITY
from runtime.estimators.regression.factor import reduce
from runtime.identification import statistics_file as statistics
from runtime.library import Array, Library, load
from runtime.parallel import on_cluster
from runtime.recording.formats.npz import arrays_of, open_npz, record_from_arrays, refusing
from runtime.recording.settings import WIDTHS, widths_of


@dataclass(frozen=True, slots=True)
class Unit:
    """Contribution of one unit."""

    name: str  # of the unit
    # widths of these columns: coulomb_speed, stribeck_speed [rad/s], dahl_stroke [rad]
    widths: tuple[float, float, float]
    factor: Array  # A, (n_b, n_b), in units of the noise
    target: Array  # b, (n_b,)
    # f, G and v per joint and column, (n, k, n_b + 2); v is infinite where the log does not
    # determine the coefficient
    friction: Array
    noise: Array  # standard deviation of the torque per joint, (n,) [N·m, N]; NaN where not known
    density: float  # S, variance with which noise over its standard deviation enters the unknowns
    columns: tuple[str, ...] = ()  # names of the k friction columns that belong to the whole log


def unit_of(known: statistics.UnitStatistics, lib: Library, name: str) -> Unit:
    """Eliminate friction from the statistics of one unit."""
    base = lib.base_matrix
    over_beta = replace(known.statistics, base_matrix=np.eye(len(base)))
    data, elimination = reduce(over_beta, lib.n_joints)
    level = max(known.density, LEAST_DENSITY)
    # Rows of A over β alone, n_b of them: the triangle of [A b].
    rows, count = np.column_stack([data.factor, data.target]) / np.sqrt(level), len(base)
    triangle, upper = np.zeros((count, count + 1)), np.linalg.qr(rows, mode="r")[:count]
    triangle[: len(upper)] = upper
    n, columns = lib.n_joints, known.shared
    # f, G and v of φ = f − G β, in the order of φ.
    variance = level * np.sum(elimination.root**2, axis=1)
    variance[elimination.undetermined] = np.inf
    friction = [elimination.phi(np.zeros(count)), -elimination.slope, variance]
    every = np.column_stack(friction).reshape(n, len(known.columns), count + 2)
    return Unit(
        name,
        known.widths,
        np.ascontiguousarray(triangle[:, :count]),
        triangle[:, count].copy(),
        np.ascontiguousarray(every[:, [known.columns.index(each) for each in columns]]),
        np.full(n, np.nan) if known.noise is None else known.noise,
        known.density,
        columns,
    )


def common_columns(units: Sequence[Unit]) -> tuple[str, ...]:
    """Friction columns that all units have with the same widths, in the order of the first."""
    first = units[0]
    names = [name for name in first.columns if all(name in unit.columns for unit in units)]
    alike = [all(unit.widths[k] == first.widths[k] for unit in units) for k in range(len(WIDTHS))]
    differing = {width for width, same in zip(WIDTHS, alike, strict=True) if not same}
    return tuple(name for name in names if not widths_of((name,)) & differing)


PART = 32  # files of one part: some tenths of a second of work
MOST_UNITS = 100_000
VERSION = 3


def statistics_files(folder: Path) -> list[Path]:
    """Files of compressed statistics in a folder and the folders below it, by name."""
    if not folder.is_dir():
        raise IdentificationError(
            f"expected a folder with the statistics of a fleet, got '{folder}'; give the folder "
            "that holds the results of identify --settings save_statistics=true"
        )
    files = [path for path in sorted(folder.rglob("*.npz")) if _is_statistics(path)]
    if not files:
        raise IdentificationError(
            f"'{folder}' holds no compressed statistics; write some with: "
            "identify LOG --settings save_statistics=true"
        )
    if len(files) > MOST_UNITS:
        raise IdentificationError(
            f"expected at most {MOST_UNITS} units in '{folder}', got {len(files)}; split the folder"
        )
    return files


def names_of(files: Sequence[Path], folder: Path) -> list[str]:
    """Names of units: the folder of statistics.npz, else the name of the file."""
    names = []
    for place in (path.relative_to(folder) for path in files):
        is_usual = place.stem == "statistics" and place.parent.name
        names.append((place.parent if is_usual else place.with_suffix("")).as_posix())
    return names


def gather(
    lib: Library,
    folder: Path,
    parts: Path,
    *,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> list[Unit]:
    """Units of a fleet, by name."""
    files = statistics_files(folder)
    named = list(zip(files, names_of(files, folder), strict=True))
    pieces = [tuple(named[k : k + PART]) for k in range(0, len(named), PART)]
    done: dict[str, list[Unit]] = {}
    places = [_place(parts, lib, piece) for piece in pieces]
    for place in places:
        known = _read(place)
        if known is not None:
            done[place.name] = known
    missing = [k for k, place in enumerate(places) if place.name not in done]
    progress(sum(map(len, done.values())), len(files))
    for k, units in _computed(lib, [(k, pieces[k]) for k in missing], scheduler):
        _write(places[k], units)
        done[places[k].name] = units
        progress(sum(map(len, done.values())), len(files))
    return [unit for place in places for unit in done[place.name]]


def remove_parts(parts: Path) -> None:
    """Remove the finished parts of a fleet whose prior is written."""
    for path in parts.glob("part-*.npz"):
        path.unlink(missing_ok=True)
    if parts.is_dir() and not any(parts.iterdir()):
        parts.rmdir()


Piece = tuple[tuple[Path, str], ...]


def _computed(
    lib: Library, work: Sequence[tuple[int, Piece]], scheduler: str | None
) -> Generator[tuple[int, list[Unit]], None, None]:
    """Parts in the order in which they end."""
    if scheduler is not None and work:
        # On a worker the working directory may be another one.
        opened = partial(load, lib.folder.resolve(), lib.level)
        tasks = [(k, tuple((p.resolve(), name) for p, name in piece)) for k, piece in work]
        yield from on_cluster(opened, _units, [tasks], scheduler, "a part of the fleet")
        return
    pool = ThreadPoolExecutor(cores())
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            yield from pool.map(partial(_units, lib), work)
    finally:
        pool.shutdown(cancel_futures=True)


def _units(lib: Library, task: tuple[int, Piece]) -> tuple[int, list[Unit]]:
    k, piece = task
    return k, [
        unit_of(statistics.require_robot(statistics.read_statistics(path), lib, path), lib, name)
        for path, name in piece
    ]


def _is_statistics(path: Path) -> bool:
    """Whether an NPZ has the mark of statistics, or its name where it cannot be opened."""
    if path.name.startswith(".") or path.is_dir():
        return False
    if not path.is_file():  # opening a pipe would wait for its other end
        return path.name == statistics.FILE
    try:
        with zipfile.ZipFile(path) as archive:
            return f"{statistics.MARK}.npy" in archive.namelist()
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return path.name == statistics.FILE


def _place(parts: Path, lib: Library, piece: Piece) -> Path:
    """File of a part, named by model, files and their state."""
    facts = [f"{VERSION} {lib.manifest.model_hash}"]
    for path, name in piece:
        try:
            state = path.stat()
        except OSError:  # a link that leads nowhere, or a file just removed: reading it says so
            facts.append(f"{name} missing")
            continue
        facts.append(f"{name} {state.st_size} {state.st_mtime_ns}")
    mark = hashlib.sha256("\n".join(facts).encode(errors="surrogateescape")).hexdigest()
    return parts / f"part-{mark[:24]}.npz"


def _write(place: Path, units: list[Unit]) -> None:
    """One part, whole or absent: the arrays of every unit behind its number."""
    arrays = {f"{k}.{key}": x for k, unit in enumerate(units) for key, x in arrays_of(unit).items()}
    with replacing(place) as file:
        np.savez(file, **arrays)


def _read(place: Path) -> list[Unit] | None:
    """Units of a part; None where it is absent or damaged, and is computed again."""
    units: dict[str, dict[str, Any]] = {}
    try:
        with refusing("", ""):
            for key, array in open_npz(bytes_of(place), place.name).items():
                number, _, name = key.partition(".")
                units.setdefault(number, {})[name] = array
            return [record_from_arrays(Unit, each, place.name) for each in units.values()]
    except IdentificationError:
        return None
