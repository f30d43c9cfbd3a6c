"""SHA-256 of raw files; a large file is hashed while its rows are read and used."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from threading import Thread
from typing import Any

from runtime.errors import RecordingError
from runtime.files import require_file

SMALL = 2**24
"""Size up to which a file is hashed at once [bytes]."""


class Digests(Mapping[str, str]):
    """File name → SHA-256; reading an entry waits until its file is hashed.

    Pickled and copied it is a plain dict.
    """

    def __init__(self) -> None:
        self._entries: dict[str, str | _Hashing] = {}

    def of_bytes(self, name: str, data: bytes) -> None:
        """Hash bytes that are in memory.

        Args:
            name: of the file.
            data: its content.
        """
        self._entries[name] = hashlib.sha256(data).hexdigest()

    def of_file(self, name: str, path: Path) -> None:
        """Hash a file, a large one in a thread of its own.

        Args:
            name: of the file.
            path: where it lies.

        Raises:
            RecordingError: it cannot be opened, or is not a regular file. What happens to it later
                is raised where the digest is needed.
        """
        with reading(path):
            small = require_file(path).stat().st_size <= SMALL
            hashing = _Hashing(path, path.open("rb"))
        if small:
            hashing.run()
        else:
            hashing.start()
        self._entries[name] = hashing.digest() if small else hashing

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
        self._path, self._file = path, file
        self._answer: str | OSError = ""

    def run(self) -> None:
        """Hash the file piece by piece; hashing a piece leaves Python's lock."""
        try:
            with self._file as file:
                self._answer = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            self._answer = error

    def digest(self) -> str:
        """The digest, as soon as it is there."""
        if self.is_alive():
            self.join()
        with reading(self._path):
            if isinstance(self._answer, OSError):
                raise self._answer
        return self._answer


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
