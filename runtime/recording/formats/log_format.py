"""A log format: the record that selects it, the base class of its readers, and their raw files.

A format is one module with a `LogFormat` and a `LogReader`, and one line in `formats.FORMATS` (or
an entry point of the group "symgen.log_formats"). A reader returns numbers as they lie in the file;
units, signs, order and gear are applied later, by the recipe. A large raw file is hashed while its
rows are read and used.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread
from typing import IO, Any, Protocol

from numpy.typing import NDArray

from runtime.common.files import require_file
from runtime.common.optional import optional
from runtime.errors import RecordingError
from runtime.library import Array
from runtime.recording.formats.tables import LogTable
from runtime.recording.recipes.recipe import Recipe, Signal, Time
from runtime.recording.recording import Recording

SMALL = 2**24  # size up to which a file is hashed at once [bytes]


class Digests(Mapping[str, str]):
    """File name → SHA-256; reading an entry waits for it, and copies are plain dicts."""

    def __init__(self) -> None:
        self._entries: dict[str, str | tuple[Path, Future[str]]] = {}

    def of_bytes(self, name: str, data: bytes) -> None:
        """Hash bytes that are in memory."""
        self._entries[name] = hashlib.sha256(data).hexdigest()

    def of_file(self, name: str, path: Path) -> None:
        """Hash a file, a large one in a thread of its own."""
        with reading(path):
            size = require_file(path).stat().st_size
            file = path.open("rb")
        digest: Future[str] = Future()
        self._entries[name] = path, digest

        def run() -> None:
            try:
                with file:
                    digest.set_result(hashlib.file_digest(file, "sha256").hexdigest())
            except OSError as error:
                digest.set_exception(error)

        if size > SMALL:
            Thread(target=run, daemon=True).start()  # a program that ends early does not wait
        else:
            run()
            self[name]  # an error of the disk is raised here

    def __getitem__(self, name: str) -> str:
        entry = self._entries[name]
        if isinstance(entry, tuple):
            path, digest = entry
            with reading(path):
                self._entries[name] = entry = digest.result()
        return entry

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn an operating system's refusal to read a file into one sentence."""
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"cannot read {path.name} in {path.parent} ({error.strerror}); "
            "check the path, or the file names in the recipe"
        ) from error


def imported(module: str, kind: str) -> Any:
    """Module of the extra `logs`."""
    return optional(module, f"reading or writing {kind}", "logs", RecordingError)


Texts = tuple[str, ...]


class LogRows(Protocol):
    """Rows of one file that stays where it is."""

    @property
    def count(self) -> int:
        """Number of rows."""

    def read(self, start: int, stop: int) -> dict[str, Array]:
        """Rows of every kind of signal.

        Args:
            start: first row.
            stop: one past the last row.

        Returns:
            kind → (stop − start, m) numbers in the units of the file.
        """


@dataclass(slots=True)
class RawFile:
    """One raw file of a recording; its bytes are read and hashed once."""

    name: str  # as in the recipe
    path: Path  # file, or folder of a bag
    recipe: Recipe  # as chosen, without the default convention
    joints: Texts  # names of the robot's joints, where the recipe has none
    in_place: bool  # the file is too large to be held
    sha256: Digests  # file name → digest of what was read; shared by all files of a recording
    _data: bytes | None = None

    def data(self) -> bytes:
        """Content of the file."""
        if self._data is None:
            with reading(self.path):
                self._data = require_file(self.path).read_bytes()
            self.sha256.of_bytes(self.name, self._data)
        return self._data

    def hashed(self) -> Path:
        """Path of a file that is not held; it is hashed piece by piece, a large one meanwhile."""
        path = self.path
        with reading(path):
            inside = [each for each in path.iterdir() if not each.is_dir()] if path.is_dir() else []
        for each in sorted(inside) or [path]:
            key = self.name if each == path else f"{self.name}/{each.name}"
            if key not in self.sha256:
                self.sha256.of_file(key, each)
        return path


@dataclass(frozen=True, slots=True, eq=False)
class Extras:
    """Content of a log file beside its signals."""

    texts: dict[str, Texts] = field(default_factory=dict)  # "name", "joint_names", … → texts
    columns: LogTable | None = None  # friction columns as rows of n·k numbers
    motors: NDArray | None = None  # (n, n) directions of coupled motors


class LogReader:
    """Reader of one raw file; a subclass overrides what its format has.

    Attributes:
        raw: the file.
        said: sentences of `convention` about what it does not read.
    """

    def __init__(self, raw: RawFile) -> None:
        self.raw = raw
        self.said: Texts = ()

    def convention(self) -> Recipe:
        """Recipe that describes a file which follows the default convention of the format.

        Raises:
            RecordingError: the file does not follow it.
        """
        raise RecordingError(
            f"{self.raw.name} is expected to be described by a recipe, but there is none; write "
            "[time], [position] and [torque] with file, layout and unit"
        )

    def table(self, kind: str, part: Signal | Time) -> LogTable:
        """Numbers of one signal.

        Args:
            kind: "time", "position", "velocity", "acceleration" or "torque".
            part: where the signal lies in the file.

        Returns:
            Table of (N, m) numbers in the units of the file.

        Raises:
            RecordingError: the file does not hold it.
        """
        raise RecordingError(f"{self.raw.name} holds no numbers of {kind} {part.unit}")

    def rows(self, parts: Mapping[str, Signal | Time]) -> LogRows:
        """Rows of several signals of a file that stays where it is.

        Args:
            parts: kind → where the signal lies in the file.

        Returns:
            Source of rows.

        Raises:
            RecordingError: the format cannot be streamed.
        """
        raise RecordingError(
            f"a log is streamed from uncompressed NPZ, Parquet, HDF5, CSV or a bag, got "
            f"{self.raw.name!r} with {', '.join(parts)}; convert it, or read it as a whole with "
            "--settings stream=false"
        )

    def extras(self) -> Extras:
        """Texts, friction columns and motor directions, as far as they were read."""
        return Extras()

    def remarks(self) -> Texts:
        """Sentences about the form of the file."""
        return self.said

    def head(self) -> list[list[str]]:
        """Cells of the first lines of a text; `inspect` looks for titles in them."""
        return []

    def arrays(self) -> dict[str, tuple[int, ...]]:
        """Name → shape of the arrays of real numbers; `inspect` looks for titles in the names."""
        return {}


@dataclass(frozen=True, slots=True, eq=False)
class LogFormat:
    """One format of log files."""

    name: str  # layout that a recipe states
    sentence: str  # what the files are
    suffixes: Texts  # of its files, in lower case; the first is that of files that are written
    reader: Callable[[RawFile], LogReader]  # class of its readers
    marker: str = ""  # file that makes a folder one log of this format
    write: Callable[[Recording, IO[bytes]], None] | None = None  # None if not written
    has_titles: bool = False  # `inspect` proposes a recipe from the titles in bare files
    reads_time_alone: bool = False  # streams the rows of time without those of the signals
    is_one_file: bool = False  # rows of two such files cannot become one recording


def require_whole_columns(parts: Mapping[str, Signal | Time], name: str) -> None:
    """Refuse to stream numbers that a recipe picks from arrays or lists."""
    if any(isinstance(p, Signal) and (p.cells or (p.key and p.columns)) for p in parts.values()):
        raise RecordingError(
            f"{name} is streamed by whole arrays and columns, but the recipe picks numbers from "
            "arrays or cells; read it as a whole with --settings stream=false"
        )


@contextmanager
def undamaged(name: str, kind: str) -> Iterator[None]:
    """Turn whatever a library raises on a damaged file into one sentence; kind: "an HDF5 file"."""
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(
            f"{name} is expected to be {kind}, but it is truncated, damaged or another file "
            f"({type(error).__name__}); copy or export it again"
        ) from error
