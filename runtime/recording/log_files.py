"""The raw files of one recording: found, read and hashed once, and turned into tables.

Which columns of which file are asked for, the recipe says; where it is silent, the default
convention does.
"""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.files import require_file
from runtime.recording.formats import tables
from runtime.recording.formats.joint_states import JointLog, MessageRows, read_joint_states
from runtime.recording.formats.parquet import ParquetLog, parquet_columns
from runtime.recording.formats.row_sources import NpzRows
from runtime.recording.formats.spool import head_of_text
from runtime.recording.recipes.default_convention import (
    bag_convention,
    csv_convention,
    npz_convention,
    parquet_convention,
)
from runtime.recording.recipes.recipe import Recipe, Signal, Time

SUFFIXES = {
    ".npz": "npz",
    ".csv": "csv",
    ".txt": "csv",
    ".tsv": "csv",
    ".parquet": "parquet",
    ".mcap": "bag",
    ".bag": "bag",
    ".db3": "bag",
}
BAG_FILE = "metadata.yaml"
"""What makes a folder a ROS 2 bag."""
Text = tuple[str, ...]


def parts_of(recipe: Recipe) -> dict[str, Signal | Time]:
    """Everything that a recipe reads from files, by kind; the time first, unless it is a rate."""
    parts: dict[str, Signal | Time] = {}
    if recipe.time is not None and recipe.time.rate_hz is None:
        parts["time"] = recipe.time
    return {**parts, **recipe.signals()}


def columns_of(part: Signal | Time) -> tables.Columns:
    """The columns of a table that a part of a recipe names."""
    return part.columns if isinstance(part, Signal) else (part.column,)


@dataclass(slots=True)
class Files:
    """The raw files of one recording: each is read and hashed once.

    Attributes:
        place: file, folder of raw files, or bag.
        recipe: what is asked for.
        joints: names that pick joints of a bag where the recipe does not.
        in_place: large files are not held.
        sha256: file name → digest of what was read.
    """

    place: Path
    recipe: Recipe
    joints: tuple[str, ...] = ()
    in_place: bool = False
    sha256: dict[str, str] = field(default_factory=dict)
    _data: dict[str, bytes] = field(default_factory=dict)
    _arrays: dict[str, dict[str, NDArray]] = field(default_factory=dict)
    _bag: JointLog | None = None
    _bag_name: str = ""

    def plan(self) -> Recipe:
        """The recipe with its signals: its own, or those of the default convention."""
        if self.recipe.position is not None:
            return self.recipe
        name = self.file_of("")
        layout = self.layout_of(name, "")
        if layout == "npz":
            default = npz_convention(self._keys(name))
        elif layout == "parquet":
            with closing(ParquetLog(self.hashed(name))) as log:
                default = parquet_convention(log.columns, name)
        elif layout == "bag":
            default = bag_convention(self._messages(name))
        else:
            default = csv_convention(self._text(name), name)
        return default.replace(
            time=self.recipe.time or default.time,
            joints=self.recipe.joints or default.joints,
            name=self.recipe.name,
            gear=self.recipe.gear,
        )

    def table(self, kind: str, part: Signal | Time) -> tables.Table:
        """The numbers that one part of the recipe asks for."""
        name = self.file_of(part.file)
        layout = self.layout_of(name, part.layout)
        if layout == "bag":
            return self._messages(name).table(_bag_key(kind, part), name)
        if layout == "parquet":
            with closing(ParquetLog(self.hashed(name))) as log:
                return log.table(parquet_columns(columns_of(part), part.key, log.columns))
        if layout == "npz":
            return tables.npz_table(self._npz(name), part.key, name)
        text = self._text(name)
        if layout == "flat":
            return tables.flat_table(text, part.width if isinstance(part, Signal) else 1, name)
        columns = columns_of(part)
        if not columns or columns == ("",):
            raise RecordingError(f"the recipe names no columns of {name}; write columns = [...]")
        return tables.csv_table(text, columns, name)

    def extras(self) -> dict[str, Text]:
        """The names and the history that an NPZ of our own carries; the joints that a bag names."""
        if self._bag is not None:
            return {"joint_names": self._bag.names}
        arrays = next(iter(self._arrays.values()), {}) if self.recipe.position is None else {}
        keys = ("name", "joint_names", "column_names", "history")
        texts = {
            key: arrays[key]
            for key in keys
            if key in arrays and arrays[key].dtype.kind == "U" and arrays[key].size
        }
        return {key: tuple(map(str, text.ravel())) for key, text in texts.items()}

    def columns(self) -> tables.Table | None:
        """The friction columns that an NPZ of our own carries, as rows of n·k numbers."""
        arrays = next(iter(self._arrays.values()), {}) if self.recipe.position is None else {}
        if "columns" not in arrays or arrays["columns"].ndim != 3:
            return None
        values = arrays["columns"].reshape(len(arrays["columns"]), -1).astype(np.float64)
        return tables.Table(values, np.arange(len(values), dtype=np.int64))

    def motors(self) -> NDArray | None:
        """The directions of coupled motors that an NPZ of our own carries beside its columns."""
        arrays = next(iter(self._arrays.values()), {}) if self.recipe.position is None else {}
        found = arrays.get("motors")
        return None if found is None or found.dtype.kind != "f" else found

    def pin_notes(self) -> list[str]:
        """A sentence for every file whose bytes are not those that the recipe pins."""
        pins = self.recipe.source.sha256
        return [
            f"Warning: {name} is not the published file that recipe {self.recipe.name!r} pins."
            for name, digest in self.sha256.items()
            if name in pins and pins[name] != digest
        ]

    def file_of(self, name: str) -> str:
        """The file that a part means: in a file path with a one-file recipe, that path."""
        if self.place.is_dir() and not is_bag(self.place):
            if not name:
                raise RecordingError(
                    f"the recipe for the folder {self.place.name} names no file; "
                    "write file = ... for time and every signal"
                )
            name = name.replace("{run}", self.recipe.run)
            if Path(name).is_absolute() or ".." in Path(name).parts:
                raise RecordingError(
                    f"the recipe names the file {name!r}, which does not lie in the folder "
                    f"{self.place.name}; move it there"
                )
            return name
        parts = parts_of(self.recipe).values() if self.recipe.position else ()
        several = sorted({part.file for part in parts if part.file})
        if len(several) > 1:
            raise RecordingError(
                f"the recipe reads {', '.join(several)}, but one file was given; give their folder"
            )
        return self.place.name

    def path(self, name: str) -> Path:
        """Where a file of the recording lies."""
        inside = self.place.is_dir() and not is_bag(self.place)
        return self.place / name if inside else self.place

    def _bytes(self, name: str) -> bytes:
        if name not in self._data:
            data = raw_bytes(self.path(name))
            self._data[name] = data
            self.sha256[name] = hashlib.sha256(data).hexdigest()
        return self._data[name]

    def hashed(self, name: str) -> Path:
        """The path of a file that is too large to be held, hashed piece by piece."""
        path = self.path(name)
        with _reading(path):
            inside = [each for each in path.iterdir() if not each.is_dir()] if path.is_dir() else []
        files = sorted(inside) or [path]
        for each in files:
            key = name if each == path else f"{name}/{each.name}"
            if key not in self.sha256:
                with _reading(each), require_file(each).open("rb") as file:
                    self.sha256[key] = hashlib.file_digest(file, "sha256").hexdigest()
        return path

    def message_rows(self, name: str, parts: Mapping[str, Signal | Time]) -> MessageRows:
        """What parts of the recipe ask a bag for, row by row."""
        keys = {kind: _bag_key(kind, part) for kind, part in parts.items()}
        return self._messages(name).rows(keys, name)

    def remarks(self) -> tuple[str, ...]:
        """What a bag's form asked for, a sentence each."""
        return () if self._bag is None else self._bag.remarks

    def _messages(self, name: str) -> JointLog:
        if self._bag_name not in {"", name}:
            raise RecordingError(
                f"the recipe reads the bags {self._bag_name} and {name}, whose messages have no "
                "common rows; read one bag"
            )
        if self._bag is None:
            self._bag_name = name
            wanted = self.recipe.joints or self.joints
            self._bag = read_joint_states(self.hashed(name), self.recipe.topic, wanted)
        return self._bag

    def _text(self, name: str) -> str:
        """A text, or the head of one that stays in its file."""
        if self.in_place:
            return head_of_text(self.hashed(name))
        return tables.decode(self._bytes(name), name)

    def _keys(self, name: str) -> tuple[str, ...]:
        """The arrays of an NPZ, which stay in their file where they are read row by row."""
        return tuple(NpzRows(self.hashed(name)).keys if self.in_place else self._npz(name))

    def _npz(self, name: str) -> dict[str, NDArray]:
        if name not in self._arrays:
            self._arrays[name] = tables.open_npz(self._bytes(name), name)
        return self._arrays[name]

    def layout_of(self, name: str, layout: str) -> str:
        """The layout that a recipe states, or that of the file's suffix."""
        if not layout and is_bag(self.place):
            return "bag"
        suffix = Path(name).suffix.lower()
        if not layout and suffix not in SUFFIXES:
            raise RecordingError(
                f"expected a file that ends in {', '.join(SUFFIXES)}, got {name!r}; "
                "rename it or state its layout in a recipe"
            )
        return layout or SUFFIXES[suffix]


def _bag_key(kind: str, part: Signal | Time) -> str:
    """The field of JointState that a part means."""
    return part.key or {"time": "", "torque": "effort"}.get(kind, kind)


def is_bag(place: Path) -> bool:
    """Whether a folder is a ROS 2 bag."""
    return (place / BAG_FILE).is_file()


def raw_bytes(path: Path) -> bytes:
    """The bytes of a file.

    Raises:
        RecordingError: it cannot be read, or is no regular file.
    """
    with _reading(path):
        return require_file(path).read_bytes()


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"cannot read {path.name} in {path.parent} ({error.strerror}); "
            "check the path, or the file names in the recipe"
        ) from error
