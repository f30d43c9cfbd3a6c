"""Files that are there as a whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from runtime.errors import RuntimeFault


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A binary file that takes the place of `path` when the block ends without an error.

    Missing folders are made. Whatever goes wrong, the old file stays as it was.

    Raises:
        RuntimeFault: the place cannot be written.
    """
    if not path.name:
        raise RuntimeFault(f"cannot write '{path}': it names no file")
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with draft.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft, path)
    except OSError as error:
        reason = error.strerror or error
        raise RuntimeFault(f"cannot write '{path}' ({reason}); choose another place") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
