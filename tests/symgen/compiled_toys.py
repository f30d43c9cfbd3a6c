"""Toys of the emitter's tests: written, compiled, called, or only read by a compiler."""

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from runtime.library.binding import LEVELS
from symgen.emit.files import emit
from symgen.kernel import Kernel
from tests.symgen.builds import compile_library

FACTS = {
    "gravity": [0.0, 0.0, -9.81],
    "base": "base",
    "tip": "tip",
    "base_parameters": {"columns": [0]},
    "pi0": [1.0],
    "joints": [],
    "pi_names": ["m"],
    "lam_names": ["mu"],
    **dict.fromkeys(("torque_rate", "tip_speed", "braking")),
    **dict.fromkeys(("proxy", "pair", "moving_proxies"), ()),
}
VERSIONS = {"symgen": "0", "casadi": "0"}


def write_toy(folder: Path, kernels: tuple[Kernel, ...]) -> None:
    """Emit a robot named toy into a folder."""
    for name, text in emit("toy", kernels, FACTS, VERSIONS).items():
        (folder / name).write_text(text, encoding="utf-8")


def compiled_toy(folder: Path, kernels: tuple[Kernel, ...]) -> ctypes.CDLL:
    """Emit, compile at every level and load."""
    write_toy(folder, kernels)
    once, *others = ([folder / name] for name in ("kernels.c", "tiles.c", "reference.c"))
    compile_library(once, folder / "libtoy.so", *others)
    return ctypes.CDLL(str(folder / "libtoy.so"))


def best_level(dll: ctypes.CDLL) -> int:
    """Place in `LEVELS` of the level that the library chooses on this processor."""
    answer = dll["toy_level"]
    answer.restype = ctypes.c_char_p
    return LEVELS.index(answer().decode())


def runnable(dll: ctypes.CDLL, kernel: str) -> list[str]:
    """Levels on tiles that this processor can run and that have a kernel."""
    levels = LEVELS[1 : best_level(dll) + 1]
    here = [level for level in levels if hasattr(dll, f"toy_{level}_{kernel}_batch")]
    assert "portable" in here
    return here


def run(dll: ctypes.CDLL, level: str, kernel: str, x: np.ndarray, width: int) -> np.ndarray:
    """One batch through a kernel of one input."""
    out = np.full((len(x), width), -7.0)
    dll[f"toy_{level}_{kernel}_batch"](
        ctypes.c_long(len(x)),
        ctypes.c_void_p(x.ctypes.data),
        ctypes.c_long(x.shape[1]),
        ctypes.c_void_p(out.ctypes.data),
    )
    return out


def assert_accepted(
    folder: Path, words: Sequence[str], tools: tuple[str, ...] = ("cc", "gcc", "clang")
) -> None:
    """The first of the compilers that is there finds no fault in files of the folder."""
    compiler = next(filter(None, map(shutil.which, tools)), None)
    if compiler is None:
        pytest.skip(f"no {' or '.join(tools)} on the PATH")
    run = subprocess.run(
        [compiler, "-fsyntax-only", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
