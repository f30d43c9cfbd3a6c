"""Lock of a folder for one run at a time, released when its process ends.

The operating system releases the lock of an open file with its process, so that a killed run leaves
no stale lock. The process id in the file serves the message only.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from runtime.errors import RuntimeFault

NAME = "run.lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder within the block."""
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
    except OSError as error:
        raise RuntimeFault(
            f"cannot write '{folder}' ({error.strerror}); choose another place with --out"
        ) from None
    try:
        if not _take(file):
            holder = os.read(file, 20).decode(errors="replace").strip() or "unknown"
            raise RuntimeFault(
                f"process {holder} is using '{folder}'; wait for it, or choose "
                "another place with --out"
            )
        with suppress(OSError):  # the process id is optional, and the disk may be full
            os.ftruncate(file, 0)
            os.pwrite(file, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(file)


def _take(file: int) -> bool:
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return False
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
