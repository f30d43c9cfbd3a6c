"""What the compilers make of the generated C: no warning, no state, no import beyond libm."""

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from runtime.library import Library
from symgen.build import PER_LEVEL
from symgen.compiler import FLAGS, LEVELS, VECTOR_FLAGS, machine

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-Wconversion")
MATHS = {
    "acos", "asin", "atan", "atan2", "cos", "exp", "fabs", "fmax", "fmin", "log", "pow", "sin",
    "sincos", "sqrt", "tan", "tanh",
}  # fmt: skip
"""Functions of <math.h>; sincos is what GCC makes of a sine beside its cosine."""


def once(lib: Library) -> list[str]:
    """Sources that belong to no level."""
    names = sorted(path.name for path in lib.folder.glob("*.c"))
    return [name for name in names if name not in PER_LEVEL]


def per_level(lib: Library) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Object → source and flags of what is compiled once per instruction set."""
    units = {}
    for level, (width, march) in LEVELS.get(machine(), {"portable": (1, "")}).items():
        extra = (f"-DLEVEL={level}", f"-DW={width}", *((f"-march={march}",) if march else ()))
        for name in PER_LEVEL:
            if (lib.folder / name).exists():
                units[f"{Path(name).stem}_{level}.o"] = (name, extra)
    return units


def compiler_run(command: list[str], folder: Path) -> None:
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"{' '.join(command)}\n{run.stderr[:2000]}"


@pytest.fixture(params=["gcc", "clang"])
def tool(request: pytest.FixtureRequest) -> str:
    """A compiler of the machine, or a skip that says which is missing."""
    if shutil.which(request.param) is None:
        pytest.skip(f"{request.param} is not on the PATH")
    return request.param


@pytest.fixture(scope="module")
def objects(robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Objects of the gantry as `symgen build` compiles them, every warning an error."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not on the PATH")
    lib, folder = robot("gantry"), tmp_path_factory.mktemp("objects")
    for file in lib.folder.glob("*.[ch]"):
        shutil.copy(file, folder)
    units = {f"{Path(name).stem}.o": (name, ()) for name in once(lib)}
    units |= {o: (s, (*VECTOR_FLAGS, *extra)) for o, (s, extra) in per_level(lib).items()}
    commands = [
        ["gcc", *FLAGS, "-Werror", "-Wconversion", *extra, "-c", source, "-o", unit]
        for unit, (source, extra) in units.items()
    ]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda command: compiler_run(command, folder), commands))
    return folder


def test_fr3_is_clean_under_strict_warnings(fr3: Library, tool: str) -> None:
    """Oracle: both compilers, each file at each level; ISO C alone where no vectors are used."""
    for source in once(fr3):
        compiler_run([tool, *STRICT, "-pedantic", "-fsyntax-only", source], fr3.folder)
    for source, extra in per_level(fr3).values():
        compiler_run([tool, *STRICT, *extra, "-fsyntax-only", source], fr3.folder)


def symbols(path: Path) -> list[tuple[str, str]]:
    """(kind, name) of an object's symbols, as nm lists them."""
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("nm is not on the PATH")
    run = subprocess.run([nm, str(path)], capture_output=True, text=True, check=True)
    return [tuple(line.split()[-2:]) for line in run.stdout.splitlines()]  # type: ignore[misc]


def test_objects_have_no_state_and_import_maths_only(objects: Path) -> None:
    """Oracle: nm; nothing writable, no allocation, no lock, nothing but libm and mem*."""
    paths = sorted(p for p in objects.glob("*.o") if p.name != "example.o")
    assert {"kernels.o", "reference.o"} <= {p.name for p in paths}
    assert any(p.name.startswith("tiles_") for p in paths)
    own = {name for path in paths for kind, name in symbols(path) if kind == "T"}
    # what the processor can do, asked once by <robot>_level
    processor = {"__cpu_model", "__cpu_indicator_init", "__cpu_features2"}
    for path in paths:
        for kind, name in symbols(path):
            assert kind not in set("bBdDcCsSgG"), (path.name, kind, name)
            if kind == "U":
                allowed = MATHS | own | {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"}
                allowed |= processor if path.name == "kernels.o" else set()
                assert name in allowed, (path.name, name)


def test_objects_export_the_robot_s_names_only(objects: Path) -> None:
    """Oracle: nm; two robots can be linked into one program."""
    for path in objects.glob("*.o"):
        if path.name != "example.o":
            names = [name for kind, name in symbols(path) if kind.isupper() and kind != "U"]
            assert names
            assert all(name.startswith("gantry_") for name in names), path.name
