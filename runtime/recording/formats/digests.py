"""SHA-256 of raw files; a large file is hashed while its rows are read and used."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from threading import Event, Thread
from typing import Any

from runtime.errors import RecordingError
from runtime.files import require_file

SMALL = 2**24
"""Size up to which a file is hashed at once [bytes]."""
CACHED = 2**32
"""Size up to which the system is expected to keep a file in memory, so that it is read from the
disk once although it is hashed later [bytes]."""


class Digests(Mapping[str, str]):
    """File name → SHA-256; reading an entry waits until its file is hashed.

    Pickled and copied it is a plain dict.
    """

    def __init__(self) -> None:
        self._entries: dict[str, str | _Hashing] = {}

    def of_bytes(self, name: str, data: bytes) -> None:
        """Hash bytes that are in memory."""
        self._entries[name] = hashlib.sha256(data).hexdigest()

    def of_file(self, name: str, path: Path) -> None:
        """Hash a file, a large one in a thread of its own."""
        with reading(path):
            small = require_file(path).stat().st_size <= SMALL
            hashing = _Hashing(path, path.open("rb"))
        if small:
            hashing.run()
        else:
            hashing.start()
        self._entries[name] = hashing.digest() if small else hashing

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Do not hash meanwhile, while all processors are busy; a file beyond `CACHED` goes on."""
        waiting = [each for each in self._entries.values() if isinstance(each, _Hashing)]
        for hashing in waiting:
            hashing.pause()
        try:
            yield
        finally:
            for hashing in waiting:
                hashing.go_on()

    def __getitem__(self, name: str) -> str:
        entry = self._entries[name]
        if isinstance(entry, _Hashing):
            self._entries[name] = entry = entry.digest()
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


class _Hashing(Thread):
    """One file; a daemon, so that a program that ends early does not wait for it."""

    def __init__(self, path: Path, file: BufferedReader) -> None:
        super().__init__(daemon=True)
        self._path, self._file = path, _Pausable(file)
        self._is_cached = path.stat().st_size <= CACHED
        self._answer: str | OSError = ""

    def run(self) -> None:
        """Hash the file piece by piece; hashing a piece leaves Python's lock."""
        try:
            with self._file.file:
                self._answer = hashlib.file_digest(self._file, "sha256").hexdigest()
        except OSError as error:
            self._answer = error

    def pause(self) -> None:
        """Stop after the present piece, unless the file is too large to be read later."""
        if self._is_cached:
            self._file.may_read.clear()

    def go_on(self) -> None:
        """End a pause."""
        self._file.may_read.set()

    def digest(self) -> str:
        """The digest, as soon as it is there."""
        self.go_on()
        if self.is_alive():
            self.join()
        with reading(self._path):
            if isinstance(self._answer, OSError):
                raise self._answer
        return self._answer


class _Pausable:
    """A file whose next piece is read as soon as it may be.

    Attributes:
        file: open for reading.
        may_read: cleared during a pause.
    """

    def __init__(self, file: BufferedReader) -> None:
        self.file, self.may_read = file, Event()
        self.may_read.set()

    def readable(self) -> bool:
        """Whether the file is open for reading."""
        return self.file.readable()

    def readinto(self, buffer: bytearray) -> int:
        """Read the next piece into a buffer and return its length."""
        self.may_read.wait()
        return self.file.readinto(buffer)


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
