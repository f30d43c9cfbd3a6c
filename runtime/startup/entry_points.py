"""Entry points of installed packages.

`importlib.metadata` imports the reader of mail, and reads and parses the entry points of every
package again for each group, together 40 ms. Most installations have no plugin of symgen, and a
search for the heading of a group in the same files shows that.
"""

import os
import sys
from functools import lru_cache
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_METADATA = (".dist-info", ".egg-info")


def entry_points(group: str) -> "list[EntryPoint]":
    """Return the entry points of a group, of all installed packages."""
    texts = _texts(tuple((path, _modified(path)) for path in sys.path))
    if texts is not None and f"[{group}]".encode() not in texts:
        return []
    from importlib.metadata import entry_points as read

    return list(read(group=group))


def _modified(path: str) -> int:
    """Time at which packages were last added to a folder [ns], 0 where there is none."""
    try:
        return os.stat(path or ".").st_mtime_ns
    except OSError:
        return 0


def _texts(places: tuple[tuple[str, int], ...]) -> bytes | None:
    """All files of entry points; None where packages may be in archives or come from finders."""
    finders = (finder for finder in sys.meta_path if finder is not PathFinder)
    if any(hasattr(finder, "find_distributions") for finder in finders):
        return None
    parts = [_text(*place) for place in places]
    return None if None in parts else b"\n".join(part for part in parts if part)


@lru_cache(maxsize=64)
def _text(path: str, modified: int) -> bytes | None:
    """Files of entry points in one folder, read again when it has changed; None for an archive."""
    del modified
    if path.endswith(".egg") or os.path.isfile(path):
        return None
    parts = []
    try:
        names = os.listdir(path or ".")
    except OSError:  # as importlib.metadata: no such folder, no packages
        return b""
    for name in names:
        if name.lower().endswith(_METADATA):
            try:
                with open(os.path.join(path, name, "entry_points.txt"), "rb", buffering=0) as file:
                    parts.append(file.readall())
            except OSError:  # a package without entry points
                continue
    return b"\n".join(parts)
