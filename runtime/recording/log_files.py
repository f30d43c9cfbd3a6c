"""The raw files of one recording: located, opened by their format and hashed once.

Known data sets lie in the package, in $SYMGEN_DATA, in `shared` beside the repository, or are
downloaded. A download is pinned by commit and sha256 in the bundled recipe of the set, and is kept
in the cache folder of the operating system.
"""

import logging
import os
import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from runtime.errors import RecordingError
from runtime.recording.formats import FORMATS, all_suffixes, format_of_folder, format_of_suffix
from runtime.recording.formats.log_format import Digests, Extras, LogFormat, LogReader, RawFile
from runtime.recording.formats.tables import LogTable
from runtime.recording.recipes.recipe import NUMBERS, Recipe, Signal, Time
from runtime.recording.recipes.recipe_file import bundled_names, load_recipe

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"  # logs of the package: <name>.npz


def known_names() -> tuple[str, ...]:
    """Names of the known data sets: the examples of the package, then those of bundled recipes."""
    return (*sorted(path.stem for path in EXAMPLES.glob("*.npz")), *bundled_names())


def locate(name: str) -> Path:
    """Log or folder with the raw files of a known data set, downloaded where necessary."""
    if name not in known_names():
        raise RecordingError(
            f"there is no data set {name!r}; the known ones are {', '.join(known_names())}"
        )
    if name not in bundled_names():
        return EXAMPLES / f"{name}.npz"
    for folder in _local_folders(name):
        if folder.is_dir():
            return folder
    return _download(name)


def _local_folders(name: str) -> list[Path]:
    """$SYMGEN_DATA/data/name if that is set, else ../shared/data/name beside the repository."""
    root = os.environ.get("SYMGEN_DATA", "")
    if root:
        return [Path(root) / "data" / name]
    repository = Path(__file__).resolve().parents[2]
    return [repository.parent / "shared" / "data" / name]


def _download(name: str) -> Path:
    """The pinned files of a data set in the cache of pooch."""
    import pooch  # a third of a second, which logs from files need not wait for

    source = load_recipe(name).source
    tried = " and ".join(str(folder) for folder in _local_folders(name))
    advice = f"set SYMGEN_DATA to the folder that holds data/{name}"
    if not source.base or not source.sha256:
        raise RecordingError(
            f"the data set {name!r} is not in {tried} and its files cannot be "
            f"downloaded; get them from {source.url} and {advice}"
        )
    folder = Path(pooch.os_cache("symgen")) / "data" / name
    fetcher = pooch.create(
        path=folder,
        base_url=source.base.replace("{commit}", source.commit),
        registry={file: f"sha256:{digest}" for file, digest in source.sha256.items()},
    )
    log = logging.getLogger(__name__)
    try:
        for file in source.sha256:
            log.info("data set %s: fetching %s (commit %.8s)", name, file, source.commit)
            fetcher.fetch(file)
    except (OSError, ValueError) as error:
        if folder.is_dir() and not any(folder.iterdir()):
            shutil.rmtree(folder)
        raise RecordingError(
            f"the data set {name!r} is not in {tried} and could not be downloaded "
            f"({type(error).__name__}); {advice}, or try again with a network"
        ) from error
    return folder


PICKLES = (".pt", ".pth", ".pkl", ".pickle")  # suffixes of files that only unpickling reads
MOST_JOINTS = 64  # length up to which an array with one axis holds one number per joint


def parts_of(recipe: Recipe) -> dict[str, Signal | Time]:
    """Everything that a recipe reads from files, by kind; the time first, unless it is a rate."""
    parts: dict[str, Signal | Time] = {}
    if recipe.time is not None and recipe.time.rate_hz is None:
        parts["time"] = recipe.time
    extra = {f"extra.{name}": signal for name, signal in recipe.extra.items()}
    return {**parts, **recipe.signals(), **recipe.of_law(), **extra}


@dataclass(slots=True)
class LogFiles:
    """The raw files of one recording."""

    place: Path  # file, folder of raw files, or folder that is one log
    recipe: Recipe  # as chosen, empty for the default convention
    joints: tuple[str, ...] = ()  # names that select joints of a bag where the recipe does not
    in_place: bool = False  # large files are not held
    sha256: Digests = field(default_factory=Digests)  # file name → digest of what was read
    _raw: dict[str, RawFile] = field(default_factory=dict)
    _readers: dict[tuple[str, str], LogReader] = field(default_factory=dict)

    def plan(self) -> Recipe:
        """The recipe with its signals, or with those of the default convention."""
        if self.recipe.position is not None:
            return self._with_numbers(self.recipe)
        reader = self.reader(self.file_of(""), "")
        default = reader.convention()
        if self.recipe.law is not None:
            reader.said = ()  # the law reads arrays that the convention does not know
        law = self.recipe.law or default.law
        plan = default.replace(
            time=self.recipe.time or default.time,
            joints=self.recipe.joints or default.joints,
            name=self.recipe.name,
            gear=self.recipe.gear,
            extra=self.recipe.extra,
            leave_out=self.recipe.leave_out,
            law=law,
            torque=default.torque if law is None else None,
        )
        return self._with_numbers(plan)

    def _with_numbers(self, plan: Recipe) -> Recipe:
        """The plan with the numbers of gains that a law takes from constant arrays of an NPZ."""
        law = plan.law
        if law is None:
            return plan
        numbers: dict[str, Any] = {}
        for key, part in plan.of_law().items():
            if key not in NUMBERS or part.columns:
                continue
            reader = self.reader(self.file_of(part.file), part.layout)
            if self.in_place:
                rows = reader.rows({key: part})
                values = rows.read(0, min(rows.count, MOST_JOINTS + 1))[key]
            else:
                values = reader.table(key, part).values
            if values.shape[1] == 1 and len(values) <= MOST_JOINTS:
                numbers[key] = tuple(float(x) for x in values[:, 0])
        return plan.replace(law=replace(law, **numbers))

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Numbers of one part of the recipe."""
        return self.reader(self.file_of(part.file), part.layout).table(kind, part)

    def reader(self, name: str, layout: str) -> LogReader:
        """Open reader of a file."""
        record = self.format_of(name, layout)
        if (name, record.name) not in self._readers:
            others = [file for file, format_name in self._readers if format_name == record.name]
            if record.is_one_file and others:
                raise RecordingError(
                    f"the recipe reads the {record.name}s {others[0]} and {name}, whose messages "
                    f"have no common rows; read one {record.name}"
                )
            if name not in self._raw:
                self._raw[name] = RawFile(
                    name, self.path(name), self.recipe, self.joints, self.in_place, self.sha256
                )
            self._readers[name, record.name] = record.reader(self._raw[name])
        return self._readers[name, record.name]

    def format_of(self, name: str, layout: str) -> LogFormat:
        """Format that a recipe states, else that of the folder or of the file's suffix."""
        record = FORMATS[layout] if layout else format_of_folder(self.place)
        record = record or format_of_suffix(name)
        if Path(name).suffix.lower() in PICKLES:
            raise RecordingError(
                f"{name} holds pickled Python objects, which can run any code and are never "
                "opened; where you trust it, convert it in Python: import numpy, torch; "
                f"d = torch.load({name!r}, weights_only=True); "
                f"numpy.savez({Path(name).stem + '.npz'!r}, **{{k: v.numpy() for k, v in "
                "d.items()})"
            )
        if record is None:
            raise RecordingError(
                f"expected a file that ends in {', '.join(all_suffixes())}, got {name!r}; "
                "rename it or state its layout in a recipe"
            )
        return record

    def extras(self) -> Extras:
        """Content of the files read so far beside their signals."""
        every = [reader.extras() for reader in self._readers.values()]
        return next((each for each in every if each.texts or each.columns is not None), Extras())

    def remarks(self) -> tuple[str, ...]:
        """Sentences about the form of the files read so far."""
        return tuple(text for reader in self._readers.values() for text in reader.remarks())

    def pin_notes(self) -> list[str]:
        """A sentence for every file whose bytes are not those that the recipe pins."""
        pins = self.recipe.source.sha256
        return [
            f"Warning: {name} is not the published file that recipe {self.recipe.name!r} pins."
            for name in self.sha256
            if name in pins and pins[name] != self.sha256[name]
        ]

    def file_of(self, name: str) -> str:
        """Name of the file that a part means: for one file with a one-file recipe, that file."""
        if self._is_folder_of_files:
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
        """Path of a file of the recording."""
        return self.place / name if self._is_folder_of_files else self.place

    @property
    def _is_folder_of_files(self) -> bool:
        return self.place.is_dir() and format_of_folder(self.place) is None
