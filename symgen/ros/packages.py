"""Folders of ROS packages: the setting package, then ROS_PACKAGE_PATH, then AMENT_PREFIX_PATH.

xacro files become URDF by the package xacro, in a process of limited time and memory. A xacro file
is a program: its expressions are Python, its macros call each other. The process of `xacro_child`
lets it compute and read files of its packages, and nothing else.
"""

import logging
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from runtime.common.child import ExceededError, Limits, answer_of
from symgen.errors import BuildError

_log = logging.getLogger(__name__)

_DEPTH = 4
"""Levels below a folder of packages at which package.xml is searched."""
_SCHEME = "package:/"
_NAME = re.compile(r"[A-Za-z0-9][\w.-]*")


@dataclass(frozen=True, slots=True)
class Packages:
    """Folders in which packages are searched."""

    folders: tuple[Path, ...] = ()  # folder of a package, or a folder that holds packages

    def folder(self, name: str) -> Path:
        """Folder of a package; BuildError where no folder holds it, or the name is none."""
        if not _NAME.fullmatch(name):
            raise BuildError(
                f"'{name[:80]}' is not the name of a ROS package; "
                "expected letters, digits, '_', '-' and '.'"
            )
        for root in self._roots():
            if root.name == name and root.is_dir():
                return root
            for match in _packages_below(root, name, _DEPTH):
                return match
        for prefix in _listed("AMENT_PREFIX_PATH"):
            if (prefix / "share" / name).is_dir():
                return prefix / "share" / name
        raise BuildError(
            f"the ROS package '{name}' is not found; name its folder with --settings package=DIR, "
            "or set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
        )

    def file(self, path: Path) -> Path:
        """A path, or the file that `package://PACKAGE/path` names."""
        text = str(path)
        if not text.startswith(_SCHEME):
            return path
        name, _, rest = text.removeprefix(_SCHEME).lstrip("/").partition("/")
        return self.folder(name) / rest

    def _roots(self) -> Sequence[Path]:
        return (*self.folders, *_listed("ROS_PACKAGE_PATH"))


def _listed(variable: str) -> Iterator[Path]:
    for word in os.environ.get(variable, "").split(os.pathsep):
        if word:
            yield Path(word)


def _packages_below(root: Path, name: str, depth: int) -> Iterator[Path]:
    """Folders called `name` with a package.xml, at most `depth` levels below `root`."""
    try:
        entries = sorted(entry for entry in root.iterdir() if entry.is_dir())
    except OSError:
        return
    for entry in entries:
        if entry.name == name and (depth == _DEPTH or (entry / "package.xml").is_file()):
            yield entry
        elif depth > 1 and not entry.name.startswith(".") and not entry.is_symlink():
            yield from _packages_below(entry, name, depth - 1)


def expanded(
    path: Path, arguments: Mapping[str, str], packages: Packages, limits: Limits | None = None
) -> str:
    """Expand a xacro file."""
    if find_spec("xacro") is None:
        raise BuildError(
            f"'{path}' is a xacro file, which the package xacro expands; run: pip install xacro"
        )
    if not path.is_file():
        raise BuildError(f"cannot read the xacro file '{path}': there is no such file")
    limits = limits or Limits()
    job = {
        "path": str(path),
        "arguments": dict(arguments),
        "folders": [str(folder) for folder in packages.folders],
    }
    try:
        answer = answer_of("symgen.ros.xacro_child", job, limits)
    except ExceededError as error:
        raise BuildError(
            f"xacro cannot expand '{path}': it takes more than {error}; "
            "an expression or a macro may never end; correct the file"
        ) from None
    for message in answer.get("messages", ()):
        _log.warning("xacro: %s", message)
    if "text" in answer:
        return str(answer["text"])
    if "refused" in answer:
        raise BuildError(answer["refused"])
    reason = answer["reason"]
    hint = "; give it by --settings arg=NAME=VALUE" if "ndefined substitution arg" in reason else ""
    raise BuildError(f"xacro cannot expand '{path}': {reason}{hint}")
