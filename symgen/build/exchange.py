"""Replacement of a folder in one atomic step, so that readers never see half of it."""

import ctypes
import filecmp
import os
import shutil
from pathlib import Path

from symgen.errors import BuildError

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2


def replace_folder(new: Path, old: Path) -> None:
    """Put a folder in the place of another; files that only the old one has are kept.

    On Linux the two names are exchanged atomically (renameat2). Elsewhere, or on a file system
    without it, two renames follow each other, and the first is undone if the second fails.
    """
    if not old.exists():
        new.rename(old)
        return
    for path in old.iterdir():
        if not (new / path.name).exists() and not path.name.endswith((".so", ".tmp")):
            (shutil.copytree if path.is_dir() else shutil.copy2)(path, new / path.name)
    if not _exchange(new, old):
        aside = new.with_name(new.name + ".old")
        old.rename(aside)
        try:
            new.rename(old)
        except OSError:
            aside.rename(old)
            raise
        new = aside
    shutil.rmtree(new, ignore_errors=True)


def require_no_foreign_file(new: Path, old: Path) -> None:
    """Refuse to replace a file of a folder that no build has written."""
    if (old / "manifest.json").exists() or (old / "build.json").exists():
        return  # of an earlier build
    for path in sorted(new.iterdir()):
        mine = old / path.name
        if os.path.lexists(mine) and not (mine.is_file() and filecmp.cmp(mine, path, False)):
            raise BuildError(
                f"'{mine}' exists, and no build has written this folder; choose another --out or "
                "--name, or give --overwrite"
            )


def _exchange(a: Path, b: Path) -> bool:
    """Exchange two names atomically; False where the system does not support it."""
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    if rename is None:
        return False
    paths = (os.fsencode(a), os.fsencode(b))
    return bool(rename(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE) == 0)
