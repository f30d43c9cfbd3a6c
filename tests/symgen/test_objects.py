"""What the compilers make of the generated C: no warning, no state, no import beyond libm."""

import re
import shutil
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime.common.compiler import machine
from runtime.library import Library
from symgen.catalogue import Catalogue, make_catalogue
from symgen.chain import read_chain
from symgen.emit.files import StackBounds, stack_bounds
from symgen.emit.forms import forms_of
from symgen.emit.sample import reference_code
from symgen.make.compiler import FLAGS, LEVELS, VECTOR_FLAGS
from symgen.make.pipeline import PER_LEVEL
from symgen.make.request import bundled_request
from tests.oracle import pinocchio_model, with_parameters
from tests.robots import CASES

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
        [
            "gcc",
            *FLAGS,
            "-Werror",
            "-Wconversion",
            "-fstack-usage",
            *extra,
            "-c",
            source,
            "-o",
            unit,
        ]
        for unit, (source, extra) in units.items()
    ]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda command: compiler_run(command, folder), commands))
    return folder


def test_fr3_is_clean_under_strict_warnings(fr3: Library, tool: str) -> None:
    """Oracle: both compilers, each file at each level; ISO C alone where no vectors are used."""
    for source in once(fr3):
        compiler_run([tool, *STRICT, "-pedantic", "-fsyntax-only", source], fr3.folder)
    beside = ("-DLEVEL=portable", "-DW=1", "-DBY_SAMPLE")
    for source, extra in (*per_level(fr3).values(), ("tiles.c", beside)):
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
    paths = sorted(p for p in objects.glob("*.o") if not p.name.startswith("example"))
    assert {"kernels.o", "reference.o"} <= {p.name for p in paths}
    assert any(p.name.startswith("tiles_") for p in paths)
    defined = {name for path in paths for kind, name in symbols(path) if kind == "T"}
    for path in paths:
        for kind, name in symbols(path):
            assert kind not in set("bBdDcCsSgG"), (path.name, kind, name)
            if kind == "U":
                allowed = MATHS | defined | {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"}
                assert name in allowed, (path.name, name)


def test_objects_export_the_robot_s_names_only(objects: Path) -> None:
    """Oracle: nm; two robots can be linked into one program."""
    for path in objects.glob("*.o"):
        if not path.name.startswith("example"):
            names = [name for kind, name in symbols(path) if kind.isupper() and kind != "U"]
            assert names
            assert all(name.startswith("gantry_") for name in names), path.name


# --- stack: bounds of the emitter against the compiler's own account ------------------------------


def frames(report: Path) -> dict[str, int]:
    """Function → bytes of its frame, from `gcc -fstack-usage`; parts that GCC split off add up."""
    frame_of: dict[str, int] = {}
    for line in report.read_text(encoding="utf-8").splitlines():
        place, size, kind = line.split("\t")
        assert kind in {"static", "dynamic,bounded"}, line
        name = place.split(":")[3].split(".")[0]
        frame_of[name] = frame_of.get(name, 0) + int(size)
    return frame_of


@cache
def bounds_of(name: str) -> tuple[StackBounds, Catalogue]:
    """The emitter's bounds for a robot of the tests."""
    request = CASES[name].request(name, None) if name in CASES else bundled_request(name)
    catalogue = make_catalogue(read_chain(request.urdf, request.options))
    kernels = catalogue.kernels
    return stack_bounds(kernels, forms_of(name, kernels), reference_code(kernels)), catalogue


def test_tiles_stay_below_the_printed_stack(objects: Path) -> None:
    """Oracle: GCC's frames, added up along the deepest chain of calls of every kernel."""
    bounds, catalogue = bounds_of("gantry")
    turning, far = ("load", "store", "add"), ("sines", "sines_far", "vd_sincos_far")
    for unit, (source, _) in per_level_names().items():
        if source != "tiles.c":
            continue
        frame_of, level = frames(objects / f"{unit}.su"), unit.removeprefix("tiles_")
        turn = max(frame_of.get(name, 0) for name in turning)
        leaf = sum(frame_of.get(name, 0) for name in far)
        width = LEVELS[machine()][level][0]
        for kernel in (k for k in catalogue.kernels if not k.rare):
            stem = f"gantry_{level}_{kernel.name}"
            entry = max(frame_of[f"{stem}_batch"], frame_of.get(f"{stem}_tiles", 0))
            lanes = [f"{name}_lanes" for name in (kernel.name, *kernel.factors[:1])]
            body = frame_of.get(f"{stem}_tile", 0) + sum(frame_of.get(name, 0) for name in lanes)
            below = max(body, frame_of.get(f"{stem}_sines", 0))
            deepest = entry + max(turn, below + leaf)
            assert deepest <= bounds.tiles[width][kernel.name], (unit, kernel.name)


def per_level_names() -> dict[str, tuple[str, str]]:
    """Object without suffix → source and level."""
    return {
        f"{Path(name).stem}_{level}": (name, level)
        for level in LEVELS.get(machine(), {})
        for name in PER_LEVEL
    }


@pytest.fixture(scope="module")
def compiled(robot, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str, str], Path]:
    """Compile kernels.c and update.c of a robot once per compiler and optimisation.

    The folder has all sources, both objects, and GCC's account of the frames.
    """
    folders: dict[tuple[str, str, str], Path] = {}

    def get(tool: str, name: str, optimise: str) -> Path:
        key = tool, name, optimise
        if key not in folders:
            folder = tmp_path_factory.mktemp(f"{name}{tool}{optimise}")
            for file in robot(name).folder.glob("*.[ch]"):
                shutil.copy(file, folder)
            account = ["-fstack-usage"] if tool == "gcc" else []
            for source in ("kernels.c", "update.c"):
                compiler_run([tool, "-std=c99", optimise, *account, "-c", source], folder)
            folders[key] = folder
        return folders[key]

    return get


@pytest.mark.parametrize(
    ("name", "optimise"), [("fr3", "-O0"), *(("gantry", o) for o in ("-O0", "-O1", "-O2"))]
)
def test_single_evaluations_stay_below_the_printed_stack(
    compiled: Callable[[str, str, str], Path], name: str, optimise: str
) -> None:
    """Oracle: GCC's frames; without optimisation every value has a place of its own."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not on the PATH")
    folder = compiled("gcc", name, optimise)
    bounds, catalogue = bounds_of(name)
    compiler_run(["gcc", "-std=c99", optimise, "-fstack-usage", "-c", "reference.c"], folder)
    one, plain = frames(folder / "kernels.su"), frames(folder / "reference.su")
    for index, kernel in enumerate(catalogue.kernels):
        below = max((one[f"{name}_{factor}"] for factor in kernel.factors), default=0)
        assert one[f"{name}_{kernel.name}"] + below <= bounds.one[kernel.name], kernel.name
        loop = plain[f"{name}_casadi_{kernel.name}_batch"] + plain.get(f"casadi_f{index}", 0)
        assert loop <= bounds.reference[kernel.name], kernel.name


def test_readme_prints_the_bounds(fr3: Library) -> None:
    """Property: the largest of each file stands in the README."""
    bounds, _ = bounds_of("fr3")
    text = (fr3.folder / "README.md").read_text(encoding="utf-8")
    assert f"| `kernels.c` | {max(bounds.one.values())} |" in text
    assert f"| `reference.c` | {max(bounds.reference.values())} |" in text
    for width, tiles in bounds.tiles.items():
        assert f"| `tiles.c`, W = {width} | {max(tiles.values())} |" in text


# --- the example ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fr3", "tree", "gantry"])
def test_example_prints_what_pinocchio_says(
    robot, compiled: Callable[[str, str, str], Path], tool: str, name: str
) -> None:
    """Oracle: Pinocchio at the state that stands in the file, and with one kilogram more."""
    lib = robot(name)
    # The FR3's kernels take 6 s at -O1, which the README's own line and the other robots cover.
    folder = compiled(tool, name, "-O0" if name == "fr3" else "-O1")
    compiler_run([tool, *STRICT, "-pedantic", "-O1", "-c", "example.c"], folder)
    compiler_run([tool, "example.o", "kernels.o", "update.o", "-lm", "-o", "example"], folder)
    text = (folder / "example.c").read_text(encoding="utf-8")
    state = [
        np.array(re.search(rf" {x}\[JOINTS\] = {{(.*)}};", text)[1].split(", "), dtype=float)
        for x in ("q", "dq", "ddq")
    ]
    done = subprocess.run([str(folder / "example")], capture_output=True, text=True, check=True)
    lines, _, learnt = done.stdout.partition("one sample explains ")
    printed = np.array(re.findall(r"[+-]\d[^\s,]*", lines), dtype=float).reshape(-1, 2)
    # Orthogonal transformations keep the length of the column of tau: rounding alone.
    assert float(learnt.split()[0]) == pytest.approx(np.sum(printed[:, 0] ** 2), rel=1e-12)
    heavier = lib.pi0.copy()
    heavier[-10] += 1.0
    model = pinocchio_model(lib.urdf(), lib.gravity)
    ids = [model.getJointId(joint) for joint in lib.joint_names]
    columns = np.array([model.joints[i].idx_v for i in ids])
    x = np.zeros((3, len(columns)))
    x[:, columns] = state
    for column, pi in enumerate((lib.pi0, heavier)):
        ours = with_parameters(model, lib, pi)
        wanted = pinocchio.rnea(ours, ours.createData(), *x)[columns]
        # The tolerance of all comparisons with Pinocchio: rounding of a few hundred operations.
        np.testing.assert_allclose(printed[:, column], wanted, rtol=0, atol=1e-11)


def test_online_example_finds_the_heavier_robot(
    compiled: Callable[[str, str, str], Path], tool: str
) -> None:
    """Oracle: the truth that stands in the file, a tenth heavier."""
    folder = compiled(tool, "gantry", "-O1")
    strict = (*STRICT, "-pedantic", "-O1", "-c", "example_online.c", "-DLEVEL=portable")
    compiler_run([tool, *strict], folder)
    level = ("-DLEVEL=portable", "-DW=1", "-O1", "-ffp-contract=fast")
    for source in ("online.c", "convex.c", "tiles.c"):  # one by one, as ccache keeps objects
        compiler_run([tool, *level, "-c", source], folder)
    names = ("example_online", "online", "kernels", "update", "convex", "tiles")
    objects = [f"{name}.o" for name in names]
    compiler_run([tool, *objects, "-lm", "-o", "example_online"], folder)
    done = subprocess.run(
        [str(folder / "example_online")], capture_output=True, text=True, check=True
    )
    (line,) = done.stdout.splitlines()
    # A ripple of 0.02 N m that 2000 samples average; the guess errs by 4 N m.
    assert float(line.split()[-1]) < 1e-3
