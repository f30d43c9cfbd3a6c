"""Folders of ROS packages, which `package://NAME/path` of robot models and xacro files name.

Searched are the folders that the user states, then those of ROS_PACKAGE_PATH, and last `share` of
those of AMENT_PREFIX_PATH. A folder of the first two is the package itself, or it holds the
package: beside others, or some levels below with its package.xml.
"""

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

DEPTH = 4  # levels below a folder of packages at which package.xml is searched
NAME = re.compile(r"[A-Za-z0-9][\w.-]*")


def folders_of_package(name: str, stated: Iterable[Path]) -> Iterator[Path]:
    """Folders of a package in the order of the search; none for what is not a name."""
    if not NAME.fullmatch(name):
        return
    for root in (*stated, *_listed("ROS_PACKAGE_PATH")):
        if root.name == name and root.is_dir():
            yield root
        if (root / name).is_dir():
            yield root / name
        yield from _below(root, name, DEPTH)
    for prefix in _listed("AMENT_PREFIX_PATH"):
        if (prefix / "share" / name).is_dir():
            yield prefix / "share" / name


def _listed(variable: str) -> Iterator[Path]:
    for word in os.environ.get(variable, "").split(os.pathsep):
        if word:
            yield Path(word)


def _below(root: Path, name: str, depth: int) -> Iterator[Path]:
    """Folders called `name` with a package.xml, at most `depth` levels below `root`."""
    try:
        entries = sorted(entry for entry in root.iterdir() if entry.is_dir())
    except OSError:
        return
    for entry in entries:
        if entry.name == name and (entry / "package.xml").is_file():
            yield entry
        elif depth > 1 and not entry.name.startswith(".") and not entry.is_symlink():
            yield from _below(entry, name, depth - 1)
