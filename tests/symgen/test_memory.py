"""The generated C under sanitizers and valgrind, every function called from C alone."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from runtime.common.compiler import find_compiler, machine
from runtime.library import Library
from symgen.make.compiler import LEVELS
from symgen.make.pipeline import ONCE, PER_LEVEL
from tests.robots import levels_here
from tests.symgen.c_driver import EXPECTED, driver

INDEPENDENT = (*ONCE, "reference.c")
"""Sources of no level."""
WATCHED = ("-g0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""Flags of the sanitizers; -g0 since no compiler cache finds the folder's name in -g again."""


@dataclass(frozen=True, slots=True)
class Workbench:
    """A folder with the sources of a robot; those of no level are compiled.

    Attributes:
        lib: the robot.
        folder: of the copied sources and the objects.
        compiler: command with its flags.
    """

    lib: Library
    folder: Path
    compiler: tuple[str, ...]

    def cc(self, *words: str) -> None:
        """One compilation; skips where the compiler lacks the sanitizers' libraries.

        Without optimisation, which removes accesses before a sanitizer can watch them, and takes
        twice the time.
        """
        command = [*self.compiler, "-std=c99", "-O0", *words]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)
        if re.search(r"cannot find .*(?:asan|ubsan)", done.stderr):
            pytest.skip(f"this compiler has no sanitizer libraries: {done.stderr.strip()[:100]}")
        assert done.returncode == 0, done.stderr[:2000]

    def program(self, level: str) -> Path:
        """The program for one level; skips where this machine does not run it."""
        lib = self.lib
        if level not in levels_here(lib):
            pytest.skip(f"this machine does not run the level {level}")
        manifest = json.loads((lib.folder / "manifest.json").read_text(encoding="utf-8"))
        tiles_h = (lib.folder / "tiles.h").read_text(encoding="utf-8")
        text = driver(manifest, lib.name, level, tiles_h)
        (self.folder / f"{level}.c").write_text(text, encoding="utf-8")
        sources = [f"{level}.c", *(n for n in PER_LEVEL if (self.folder / n).exists())]
        objects = [f"{Path(name).stem}.o" for name in (*INDEPENDENT, *sources)]
        width, march = LEVELS[machine()][level]
        flags = [f"-DLEVEL={level}", f"-DW={width}", "-ffp-contract=fast"]
        flags += [f"-march={march}"] if march else []
        for source in sources:  # one by one, as ccache keeps objects
            self.cc(*flags, "-c", source)
        self.cc(*objects, "-o", level, "-lm")
        return self.folder / level


def workbench(lib: Library, folder: Path, compiler: tuple[str, ...]) -> Workbench:
    for file in lib.folder.glob("*.[ch]"):
        shutil.copy(file, folder)
    made = Workbench(lib, folder, compiler)
    for source in INDEPENDENT:
        made.cc("-c", source)
    return made


def sanitizing_compiler(folder: Path) -> tuple[str, ...]:
    """Clang if it has the sanitizers' libraries, since it instruments in half of GCC's time."""
    if shutil.which("clang") is not None:
        (folder / "empty.c").write_text("int main(void) { return 0; }\n", encoding="utf-8")
        clang = ("clang", *WATCHED)
        command = [*clang, "empty.c", "-o", "empty"]
        if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 0:
            return clang
    return (*find_compiler(), *WATCHED)


@pytest.fixture(scope="module")
def sanitized(
    robot: Callable[[str], Library], tmp_path_factory: pytest.TempPathFactory
) -> Workbench:
    """Every access and every number watched by the compiler's sanitizers."""
    folder = tmp_path_factory.mktemp("sanitized")
    return workbench(robot("gantry"), folder, sanitizing_compiler(folder))


@pytest.fixture(scope="module")
def plain(robot: Callable[[str], Library], tmp_path_factory: pytest.TempPathFactory) -> Workbench:
    """Functions keep their names without -g, whose folder names no compiler cache finds again."""
    return workbench(robot("gantry"), tmp_path_factory.mktemp("plain"), (*find_compiler(), "-g0"))


def assert_ran(done: subprocess.CompletedProcess[str]) -> None:
    """It ended well, and the programs gave numbers."""
    assert done.returncode == 0, done.stderr[:2000]
    assert done.stdout.split() == EXPECTED.split()


@pytest.mark.parametrize("level", ["portable", "v2", "v3", "v4"])
def test_no_byte_out_of_place(sanitized: Workbench, level: str):
    """Oracle: the sanitizers of the compiler; reads and writes, shifts, conversions, alignment."""
    done = subprocess.run(
        [str(sanitized.program(level))],
        cwd=sanitized.folder,
        capture_output=True,
        text=True,
        check=False,
        env={"ASAN_OPTIONS": "detect_leaks=0"},  # the driver frees nothing on purpose
    )
    assert_ran(done)


@pytest.mark.parametrize("level", ["portable", "v3"])
def test_no_uninitialised_byte_decides(plain: Workbench, level: str):
    """Oracle: valgrind's memcheck, up to AVX2, the widest set that it supports."""
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("valgrind is not installed: apt-get install valgrind")
    done = subprocess.run(
        [valgrind, "--error-exitcode=9", "--leak-check=no", "--quiet", str(plain.program(level))],
        cwd=plain.folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert_ran(done)
