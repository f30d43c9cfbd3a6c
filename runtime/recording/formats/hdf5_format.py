"""Log format HDF5: arrays as in an NPZ, at the top of the file or in one group.

`key` of a recipe is a path such as "arm/q". A MATLAB 7.3 file is HDF5, and a struct is a group.
MATLAB stores a matrix by columns, so that HDF5 states its axes in reverse order; such an array
(attribute MATLAB_class) is read with the axes that MATLAB shows, and a vector of either
orientation is one column. Soft and external links, virtual arrays and external storage can lead
to other files and are refused. Numbers are read, object references and texts are not.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.formats import log_format
from runtime.recording.formats.tables import EXPANSION, SLACK, LogTable, common_count, picked
from runtime.recording.recipes.default_convention import arrays_convention, unread_arrays
from runtime.recording.recipes.recipe import Recipe, Signal, Time

MOST_OBJECTS = 10_000  # largest number of groups and arrays of a file; logs have some dozens

_OLD_MATLAB = b"MATLAB 5.0"


class HdfLog:
    """Arrays of an HDF5 file, which is opened for every access and closed after it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.shapes: dict[str, tuple[int, ...]] = {}  # of real numbers, (rows, columns) or (rows,)
        self.links: set[str] = set()  # not followed
        self._others: set[str] = set()
        self._groups: set[int] = set()
        with self._opened() as file:
            self._list(file, "")

    def read(self, key: str, start: int, stop: int | None) -> Array:
        """Rows of one array, one per sample."""
        shape = self.shape(key)
        with self._opened() as file:
            array = file[key]
            self._require_inside(array, key)
            pick = slice(start, stop)
            if not _is_matlab(array):
                values = array[pick]
            elif len(shape) == 1:  # a row or a column of MATLAB
                values = array[0, pick] if array.shape[0] == 1 else array[pick, 0]
            else:
                values = array[:, pick].T
        return np.asarray(values, dtype=np.float64).reshape(len(values), -1)

    def shape(self, key: str) -> tuple[int, ...]:
        """Shape of one array, (rows, columns) or (rows,)."""
        if key in self.links:
            raise RecordingError(
                f"{self.path.name}: {key!r} is a link, which may lead to another file and is not "
                "followed; store the numbers themselves"
            )
        if key in self._others:
            raise RecordingError(
                f"{self.path.name}: the array {key!r} is expected to hold real numbers, but holds "
                "references, texts or structures; store it as a matrix of doubles"
            )
        if key not in self.shapes:
            raise RecordingError(
                f"{self.path.name} is expected to hold the array {key!r}, but holds "
                f"{', '.join(sorted(self.shapes)[:12]) or 'none'}; add it or name it in a recipe"
            )
        shape = self.shapes[key]
        if len(shape) not in {1, 2}:
            raise RecordingError(
                f"{self.path.name}: the array {key!r} is expected to be (samples, joints), "
                f"but is of shape {shape}; reshape it"
            )
        if 0 in shape:
            raise RecordingError(
                f"{self.path.name}: the array {key!r} is expected to hold samples, but is of shape "
                f"{shape}; export the log again"
            )
        return shape

    def _require_inside(self, array: Any, key: str) -> None:
        """Refuse numbers of other files, and more of them than the file can hold."""
        if array.is_virtual or array.external:
            raise RecordingError(
                f"{self.path.name}: the numbers of {key!r} lie in another file, which is not "
                "opened; store them in this one"
            )
        size = self.path.stat().st_size
        if max(array.nbytes, 8 * array.size) > EXPANSION * size + SLACK:
            raise RecordingError(
                f"{self.path.name} states {array.size} numbers in {size} bytes, beyond the "
                "decompression limit; it is damaged, so export it again"
            )

    def _list(self, group: Any, prefix: str) -> None:
        h5py = log_format.imported("h5py", "HDF5 and MATLAB 7.3 files")
        for name in group:
            path = f"{prefix}{name}"
            if len(self.shapes) + len(self._others) + len(self._groups) > MOST_OBJECTS:
                raise RecordingError(
                    f"{self.path.name} holds more than {MOST_OBJECTS} arrays and groups; "
                    "export the signals alone"
                )
            if name.startswith("#"):  # MATLAB's cells and tables, reached by reference only
                continue
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                self.links.add(path)
                continue
            item = group[name]
            if isinstance(item, h5py.Group):
                address = h5py.h5o.get_info(item.id).addr
                if address not in self._groups:  # hard links can form a circle
                    self._groups.add(address)
                    self._list(item, f"{path}/")
            elif isinstance(item, h5py.Dataset):
                self._note(item, path)

    def _note(self, array: Any, path: str) -> None:
        is_number = array.shape is not None and array.dtype.kind in "fiu"
        if not is_number or "MATLAB_empty" in array.attrs:
            self._others.add(path)
            return
        shape = tuple(int(n) for n in array.shape)
        if _is_matlab(array):
            shape = shape[::-1]
            shape = (max(shape),) if len(shape) == 2 and min(shape) == 1 else shape
        self.shapes[path] = shape

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        """The open file; exceptions of h5py on a damaged file become one sentence."""
        h5py = log_format.imported("h5py", "HDF5 and MATLAB 7.3 files")
        name = self.path.name
        with self.path.open("rb") as file:
            if file.read(len(_OLD_MATLAB)) == _OLD_MATLAB:
                raise RecordingError(
                    f"{name} is expected to be a MATLAB 7.3 file, but is of an older version; "
                    "save it in MATLAB with save(…, '-v7.3')"
                )
        with log_format.undamaged(name, "an HDF5 file"), h5py.File(self.path, "r") as file:
            yield file  # h5py raises OSError, RuntimeError, KeyError, ValueError …


class HdfRows:
    """Rows of several arrays of a file that stays where it is."""

    def __init__(self, log: HdfLog, kinds: Mapping[str, str]) -> None:
        self._log, self._kinds = log, dict(kinds)
        self.count = common_count(log.path, (log.shape(key)[0] for key in self._kinds.values()))

    def read(self, start: int, stop: int) -> dict[str, Array]:
        """Rows start … stop of every kind of signal."""
        return {kind: self._log.read(key, start, stop) for kind, key in self._kinds.items()}


def _is_matlab(array: Any) -> bool:
    return "MATLAB_class" in array.attrs and array.ndim >= 2


class HdfReader(log_format.LogReader):
    """Reader of an HDF5 file; its arrays are listed once."""

    @cached_property
    def _log(self) -> HdfLog:
        return HdfLog(self.raw.hashed())

    def convention(self) -> Recipe:
        """Recipe of the arrays t, q …, at the top or in the only group that holds a q."""
        present = self._log.shapes
        groups = [key.removesuffix("q") for key in present if key.endswith("/q")]
        prefix = groups[0] if "q" not in present and len(groups) == 1 else ""
        plan = arrays_convention(present, "hdf5", prefix)
        self.said = unread_arrays(self.arrays(), plan, self.raw.name)
        return plan

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Array with the key of a part."""
        rows = self._log.read(part.key, 0, None)
        table = LogTable(rows, np.arange(len(rows), dtype=np.int64))
        columns = () if kind == "time" else part.columns
        return picked(table, columns, f"the array {part.key!r} of {self.raw.name}")

    def rows(self, parts: Mapping[str, Signal | Time]) -> log_format.LogRows:
        """Rows of the arrays, read where they lie."""
        log_format.require_whole_columns(parts, self.raw.name)
        return HdfRows(self._log, {kind: part.key for kind, part in parts.items()})

    def arrays(self) -> dict[str, tuple[int, ...]]:
        """Name → shape of the arrays of real numbers."""
        return dict(self._log.shapes)


HDF5 = log_format.LogFormat(
    name="hdf5",
    sentence="arrays of numbers in HDF5 or a MATLAB 7.3 file, one row per instant",
    suffixes=(".h5", ".hdf5", ".mat"),
    reader=HdfReader,
    has_titles=True,
    reads_time_alone=True,
)
