"""Files that others wrote, read within bounds: regular, of a size, UTF-8."""

import errno
import json
import stat
from pathlib import Path
from typing import Any

LARGEST = 50 * 2**20
"""Bytes; robots are described in thousands of lines, not in millions."""


def text_of(path: Path) -> str:
    """A text; a pipe would be waited for, and a device never ends.

    Raises:
        OSError: it cannot be read, or is no regular file.
        ValueError: it is larger than any description of a robot, or no UTF-8.
    """
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    if found.st_size > LARGEST:
        raise ValueError(f"it has more than {LARGEST >> 20} MiB")
    return path.read_bytes().decode("utf-8-sig")


def json_of(path: Path) -> Any:
    """The value of a JSON document; errors as for `text_of`."""
    try:
        return json.loads(text_of(path))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
