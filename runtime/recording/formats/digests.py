"""SHA-256 of raw files; a large file is hashed while its rows are read and used."""

import hashlib
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

from runtime.common.files import require_file
from runtime.errors import RecordingError

SMALL = 2**24
"""Size up to which a file is hashed at once [bytes]."""


class Digests(Mapping[str, str]):
    """File name → SHA-256; reading an entry waits until its file is hashed.

    Pickled and copied it is a plain dict.
    """

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
