"""Bounded reading of files from outside: regular files of limited size, UTF-8 text, JSON."""

import errno
import json
import stat
from pathlib import Path
from typing import Any

LARGEST = 50 * 2**20
"""Largest file that is read, bytes. Robot descriptions have thousands of lines, not millions."""


def text_of(path: Path) -> str:
    """Return the text of a UTF-8 file, without its byte order mark.

    Pipes and devices are refused: reading them could block or never end.

    Raises:
        OSError: the file cannot be read, or is not a regular file.
        ValueError: the file is larger than `LARGEST`, or is not UTF-8.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    if status.st_size > LARGEST:
        raise ValueError(f"it has more than {LARGEST >> 20} MiB")
    return path.read_bytes().decode("utf-8-sig")


def json_of(path: Path) -> Any:
    """Return the value of a JSON file.

    Raises:
        OSError: as for `text_of`.
        ValueError: as for `text_of`, or the text is not JSON.
    """
    try:
        return json.loads(text_of(path))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
