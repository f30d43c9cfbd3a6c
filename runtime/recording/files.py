"""The raw files of one recording: found, read and hashed once, and turned into tables.

Which columns of which file are asked for, the recipe says; where it is silent, the default
convention does.
"""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording import tables
from runtime.recording.convention import csv_convention, npz_convention
from runtime.recording.recipe import Recipe, Signal, Time

SUFFIXES = {".npz": "npz", ".csv": "csv", ".txt": "csv", ".tsv": "csv"}
Text = tuple[str, ...]


def parts_of(recipe: Recipe) -> dict[str, Signal | Time]:
    """Everything that a recipe reads from files, by kind; the time first, unless it is a rate."""
    parts: dict[str, Signal | Time] = {}
    if recipe.time is not None and recipe.time.rate_hz is None:
        parts["time"] = recipe.time
    return {**parts, **recipe.signals()}


@dataclass(slots=True)
class Files:
    """The raw files of one recording: each is read and hashed once."""

    place: Path
    recipe: Recipe
    sha256: dict[str, str] = field(default_factory=dict)
    _data: dict[str, bytes] = field(default_factory=dict)
    _arrays: dict[str, dict[str, NDArray]] = field(default_factory=dict)

    def plan(self) -> Recipe:
        """The recipe with its signals: its own, or those of the default convention."""
        if self.recipe.position is not None:
            return self.recipe
        name = self._name("")
        if self._layout(name, "") == "npz":
            default = npz_convention(tuple(self._npz(name)))
        else:
            default = csv_convention(tables.decode(self._bytes(name), name), name)
        time = self.recipe.time or default.time
        return default.replace(
            time=time, joints=self.recipe.joints, name=self.recipe.name, gear=self.recipe.gear
        )

    def table(self, part: Signal | Time) -> tables.Table:
        """The numbers that one part of the recipe asks for."""
        name = self._name(part.file)
        layout = self._layout(name, part.layout)
        if layout == "npz":
            return tables.npz_table(self._npz(name), part.key, name)
        text = tables.decode(self._bytes(name), name)
        if layout == "flat":
            return tables.flat_table(text, part.width if isinstance(part, Signal) else 1, name)
        columns = part.columns if isinstance(part, Signal) else (part.column,)
        if not columns or columns == ("",):
            raise RecordingError(f"the recipe names no columns of {name}; write columns = [...]")
        return tables.csv_table(text, columns, name)

    def extras(self) -> dict[str, Text]:
        """The names and the history that an NPZ of our own carries."""
        arrays = next(iter(self._arrays.values()), {}) if self.recipe.position is None else {}
        keys = ("name", "joint_names", "column_names", "history")
        texts = {
            key: arrays[key] for key in keys if key in arrays and arrays[key].dtype.kind == "U"
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

    def _name(self, name: str) -> str:
        """The file that a part means: in a file path with a one-file recipe, that path."""
        if self.place.is_dir():
            if not name:
                raise RecordingError(
                    f"the recipe for the folder {self.place.name} names no file; "
                    "write file = ... for time and every signal"
                )
            return name.replace("{run}", self.recipe.run)
        parts = parts_of(self.recipe).values() if self.recipe.position else ()
        several = sorted({part.file for part in parts if part.file})
        if len(several) > 1:
            raise RecordingError(
                f"the recipe reads {', '.join(several)}, but one file was given; give their folder"
            )
        return self.place.name

    def _bytes(self, name: str) -> bytes:
        if name not in self._data:
            path = self.place / name if self.place.is_dir() else self.place
            try:
                data = path.read_bytes()
            except OSError as error:
                raise RecordingError(
                    f"cannot read {name} in {path.parent} ({error.strerror}); "
                    "check the path, or the file names in the recipe"
                ) from error
            self._data[name] = data
            self.sha256[name] = hashlib.sha256(data).hexdigest()
        return self._data[name]

    def _npz(self, name: str) -> dict[str, NDArray]:
        if name not in self._arrays:
            self._arrays[name] = tables.open_npz(self._bytes(name), name)
        return self._arrays[name]

    @staticmethod
    def _layout(name: str, layout: str) -> str:
        suffix = Path(name).suffix.lower()
        if not layout and suffix not in SUFFIXES:
            raise RecordingError(
                f"expected a file that ends in {', '.join(SUFFIXES)}, got {name!r}; "
                "rename it or state its layout in a recipe"
            )
        return layout or SUFFIXES[suffix]
