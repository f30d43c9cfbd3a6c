"""History of checks of a robot: one JSON object per line, only ever appended to."""

import json
import os
from pathlib import Path
from typing import Any

from runtime.errors import RecordingError
from runtime.files import text_of

KEYS = ("checked", "model_hash", "log", "changed", "p_value")
"""Keys that every line has."""


def read_history(path: Path) -> list[dict[str, Any]]:
    """Entries of a history in the order of the file; none where it does not exist."""
    if not os.path.lexists(path):
        return []
    try:
        entries = [json.loads(line) for line in text_of(path).splitlines() if line.strip()]
        if not all(isinstance(each, dict) and set(KEYS) <= set(each) for each in entries):
            raise ValueError
    except (OSError, ValueError, RecursionError):
        raise RecordingError(
            f"expected a history of watch in '{path}' (one JSON object per line), got another "
            "file; name another one with --history"
        ) from None
    return entries


def append_history(path: Path, entries: list[dict[str, Any]]) -> None:
    """Append entries to a history; what it has is kept as it is."""
    read_history(path)
    lines = "".join(f"{json.dumps(each, ensure_ascii=False)}\n" for each in entries)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as file:
            file.write(lines.encode())
    except OSError as error:
        raise RecordingError(
            f"cannot append to '{path}' ({error.strerror}); name another file with --history"
        ) from None
