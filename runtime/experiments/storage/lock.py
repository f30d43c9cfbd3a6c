"""One run at a time in a folder: a lock that its holder's death opens.

The operating system holds the lock of an open file and drops it with the process, so no stale lock
is left by a kill; the process id in the file is for the message.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from runtime.errors import RuntimeFault

NAME = "run.lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder while the block runs.

    Raises:
        RuntimeFault: another process holds it, or it cannot be written.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise RuntimeFault(
            f"cannot write '{folder}' ({error.strerror}); choose another place with --out"
        ) from None
    try:
        if not _take(file):
            holder = os.read(file, 20).decode(errors="replace").strip() or "unknown"
            raise RuntimeFault(
                f"process {holder} is at work in '{folder}' already; wait for it, or choose "
                "another place with --out"
            )
        with suppress(OSError):  # the id is a courtesy, also on a full disk
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
