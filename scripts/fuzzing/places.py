"""Other things in the place of a file: nothing, a folder, a pipe, a device, a loop of links."""

import os
import shutil
from pathlib import Path

import numpy as np

SHARE = 0.02
"""Of the files."""


def misplace(path: Path, rng: np.random.Generator) -> None:
    """Put something that is not a file into the place of a file."""
    clear(path)
    kind = int(rng.integers(7))
    if kind == 1:
        path.mkdir()
    elif kind == 2:
        os.mkfifo(path)
    elif kind == 3:
        path.symlink_to("/dev/zero")
    elif kind == 4:
        path.symlink_to(path.name)  # itself
    elif kind == 5:
        path.symlink_to("nowhere")
    elif kind == 6:
        path.write_bytes(b"")


def clear(path: Path) -> None:
    """Remove whatever is at a path."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
