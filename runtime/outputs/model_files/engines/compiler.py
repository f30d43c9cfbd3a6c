"""Read a C header by a C compiler: a program includes it and prints its arrays in hexadecimal."""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from runtime.library import Array
from runtime.outputs.model_files.engines.answer import Unreadable

INSTALL = "install a C compiler, or name one in CC"
SECONDS = 60
"""Time limit of the compiler and of its program [s]."""


def read_back(text: str, names: Mapping[str, tuple[int, ...]]) -> dict[str, Array] | None:
    """Read the arrays of a header."""
    compiler = find_compiler()
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "identified.h").write_text(text, encoding="utf-8")
        (folder / "main.c").write_text(_program(names), encoding="utf-8")
        command = [compiler, "-std=c99", "-Wall", "-Werror", "main.c", "-o", "main"]
        _run(command, folder)
        lines = _run([str(folder / "main")], folder).splitlines()
    values = iter(float.fromhex(line) for line in lines)
    return {
        name: np.array([next(values) for _ in range(int(np.prod(shape)))]).reshape(shape)
        for name, shape in names.items()
    }


def find_compiler() -> str | None:
    """Path of the compiler in CC, else of cc, gcc or clang; None where none is installed."""
    wanted = (os.environ.get("CC", ""), "cc", "gcc", "clang")
    return next((path for name in wanted if name and (path := shutil.which(name))), None)


def _program(names: Mapping[str, tuple[int, ...]]) -> str:
    loops = "".join(
        f"    for (i = 0; i < {int(np.prod(shape))}; ++i)"
        f' printf("%a\\n", ((const double *){name})[i]);\n'
        for name, shape in names.items()
    )
    return (
        '#include <stdio.h>\n#include "identified.h"\n'
        f"int main(void)\n{{\n    int i;\n{loops}    return 0;\n}}\n"
    )


def _run(command: list[str], folder: Path) -> str:
    try:
        ran = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, check=False, timeout=SECONDS
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Unreadable(error) from None
    if ran.returncode:
        complaint = re.search(r"error: .*", ran.stderr)
        raise Unreadable(complaint[0] if complaint else f"{command[0]} failed: {ran.stderr[:200]}")
    return ran.stdout
