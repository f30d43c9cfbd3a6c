"""ROS packages and xacro files.

xacro files become URDF by the package xacro, in a process of limited time and memory. A xacro file
is a program: its expressions are Python, its macros call each other. The process of `xacro_child`
lets it compute and read files of its packages, and nothing else.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from runtime.common.child import ExceededError, Limits, answer_of
from runtime.common.packages import NAME, folders_of_package
from symgen.errors import BuildError

_log = logging.getLogger(__name__)

_SCHEME = "package:/"


@dataclass(frozen=True, slots=True)
class Packages:
    """Folders in which packages are searched."""

    folders: tuple[Path, ...] = ()  # folder of a package, or a folder that holds packages

    def folder(self, name: str) -> Path:
        """Folder of a package; BuildError where no folder holds it, or the name is none."""
        if not NAME.fullmatch(name):
            raise BuildError(
                f"'{name[:80]}' is not the name of a ROS package; "
                "expected letters, digits, '_', '-' and '.'"
            )
        for folder in folders_of_package(name, self.folders):
            return folder
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
