"""Architecture: rooms and the direction of imports, length of modules, libraries of run time.

A room is a module or folder at the first level of a package; a floor is a step of the longest chain
of imports from room to room.
"""

import ast
import gc
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from runtime.recording.settings import COLUMNS
from tests.conftest import FIRST, REPOSITORY

PACKAGES = ("symgen", "runtime")
MODULES = sorted(path for package in PACKAGES for path in (REPOSITORY / package).rglob("*.py"))
SHARED = "runtime.common"
"""What both packages import."""
LONGEST = 500
MOST_ROOMS = 20
MOST_FLOORS = 12
MOST_LEVELS = 12
MOST_LATE_IMPORTS = 30
OPTIONAL = (
    *(
        "casadi",
        "coal",
        "distributed",
        "h5py",
        "matplotlib",
        "mcap",
        "mujoco",
        "pinocchio",
        "pooch",
    ),
    *("pxr", "pyarrow", "pydrake", "rclpy", "rosbags", "scipy.signal", "trimesh", "viser", "xacro"),
    *("yaml", "ziglang", "pylibfranka", "rtde_", "symgen.make."),
)
"""Libraries that an extra installs, or that take long and that most commands do not need.

`symgen.make` needs the extra `build`, and `symgen list` and `describe` do without it.
"""
ENGINES = "runtime.outputs.model_files.engines"
LIBRARIES = {
    "casadi": (),
    "pinocchio": (ENGINES,),
    "mujoco": (ENGINES, "runtime.simulation.plant_engine"),
    "pydrake": (ENGINES,),
    "pxr": (ENGINES,),
    "yaml": (ENGINES,),
    "torch": ("runtime.tapes",),
    "jax": ("runtime.tapes",),
    "jinja2": ("runtime.outputs.report",),
    "matplotlib": ("runtime.outputs.report", "runtime.experiments.report"),  # there for types
}
"""Library → the parts of runtime that may import it; they import it where they use it."""

Imports = dict[str, set[str]]
"""Module → the modules that it imports, other distributions by their top-level name."""


@pytest.fixture(scope="module")
def imports() -> Imports:
    """The import graph of both packages, imports inside functions included."""
    grimp = pytest.importorskip("grimp", reason="grimp comes with pip install symgen[test]")
    graph = grimp.build_graph(*PACKAGES, include_external_packages=True, cache_dir=None)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


@cache
def trees() -> dict[str, ast.Module]:
    """Module → its syntax tree."""
    gc.disable()  # the trees stay: passing over them again takes longer than to make them
    names = (".".join(path.relative_to(REPOSITORY).with_suffix("").parts) for path in MODULES)
    parsed = [ast.parse(path.read_text(encoding="utf-8")) for path in MODULES]
    gc.freeze()
    gc.enable()
    return {name.removesuffix(".__init__"): tree for name, tree in zip(names, parsed, strict=True)}


@cache
def nodes_of_trees() -> dict[str, tuple[ast.AST, ...]]:
    """Module → all nodes of its syntax tree."""
    return {module: tuple(ast.walk(tree)) for module, tree in trees().items()}


def is_part(module: str, of: str) -> bool:
    """True for the package or module itself and for everything below it."""
    return f"{module}.".startswith(f"{of}.")


def rooms_of(package: str, imports: Imports) -> dict[str, set[str]]:
    """Room → the other rooms of its package that it imports; the package's face is none."""

    def room(module: str) -> str:
        return ".".join(module.split(".")[1:2]) if is_part(module, package) else ""

    rooms: dict[str, set[str]] = {room(name): set() for name in imports}
    for name, imported in imports.items():
        rooms[room(name)] |= {room(other) for other in imported} - {room(name), ""}
    rooms.pop("")
    return rooms


def floors_of(arrows: Mapping[str, set[str]]) -> int:
    """Number of nodes on the longest chain of arrows.

    Raises:
        CycleError: some chain comes back to where it began; the error names it.
    """
    height: dict[str, int] = {}
    for node in TopologicalSorter(arrows).static_order():
        height[node] = 1 + max((height[other] for other in arrows.get(node, ())), default=0)
    return max(height.values())


def levels() -> list[list[str]]:
    """Rooms of the import contract, level by level, the highest first."""
    text = (REPOSITORY / "pyproject.toml").read_text(encoding="utf-8")
    contract, *_ = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    return [[name.strip(" ()") for name in level.split("|")] for level in contract["layers"]]


def test_import_contracts() -> None:
    """Oracle: import-linter with the contract of pyproject.toml."""
    program = shutil.which("lint-imports", path=str(Path(sys.executable).parent))
    if program is None:
        pytest.skip("import-linter is not installed: pip install symgen[test]")
    run = subprocess.run(
        [program, "--no-cache"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]


def test_the_contract_has_few_levels() -> None:
    """Property: the first contract has at most 12 levels, in which each room stands once."""
    names = [name for level in levels() for name in level]
    assert len(levels()) <= MOST_LEVELS
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("package", PACKAGES)
def test_rooms_are_few_and_imports_point_down(package: str, imports: Imports) -> None:
    """Property: at most 20 rooms on 12 floors, no import to the same or a higher level."""
    rooms = rooms_of(package, imports)
    level = {name: depth for depth, names in enumerate(levels()) for name in names}
    upward = [(a, b) for a, others in rooms.items() for b in others if level[b] <= level[a]]
    assert upward == []
    assert len(rooms) <= MOST_ROOMS
    assert floors_of(rooms) <= MOST_FLOORS


def test_a_circle_of_rooms_is_refused() -> None:
    """Property: what counts floors names the circle, so that none passes the test above."""
    assert floors_of({"a": {"b"}, "b": {"c"}}) == 3
    with pytest.raises(CycleError):
        floors_of({"a": {"b"}, "b": {"c"}, "c": {"a"}})


def test_modules_form_no_circle(imports: Imports) -> None:
    """Property: a topological order of all modules exists; its error names the circle."""
    assert floors_of({name: imported & imports.keys() for name, imported in imports.items()}) > 1


def test_every_module_has_a_user(imports: Imports) -> None:
    """Property: no module is left behind that nothing imports, starts or names in a registry."""
    imported = {f"{other}." for name, used in imports.items() for other in used if name != other}
    project = (REPOSITORY / "pyproject.toml").read_text()
    text = "".join([project, *(path.read_text() for path in MODULES)])
    unused = [
        name
        for name in imports
        if not any(each.startswith(f"{name}.") for each in imported)
        and not name.endswith(".__main__")
        and not re.search(rf"\b({name}|{name.rsplit('.', 1)[1]})[\":]", text)
    ]
    assert unused == []


def is_overload(node: ast.FunctionDef | ast.ClassDef) -> bool:
    """Whether a function is only a signature for type checkers."""
    return any(isinstance(d, ast.Name) and d.id == "overload" for d in node.decorator_list)


def stated_twice(tree: ast.Module) -> set[str]:
    """Names that a module states more than once; overloads state signatures of one function."""
    names: list[str] = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not is_overload(node):
            names.append(node.name)
        targets = [*node.targets] if isinstance(node, ast.Assign) else []
        targets += [node.target] if isinstance(node, ast.AnnAssign) else []
        names += [each.id for t in targets for each in ast.walk(t) if isinstance(each, ast.Name)]
    return {name for name in names if names.count(name) > 1}


def test_a_module_states_each_name_once() -> None:
    """Property: no constant, function or class replaces one of the same name above it."""
    guilty = {module: stated_twice(tree) for module, tree in trees().items()}
    assert not {module: names for module, names in guilty.items() if names}


def test_the_packages_are_independent(imports: Imports) -> None:
    """Property: symgen writes files, runtime reads them; `runtime.common` is all they share."""
    crossing = [
        (name, other)
        for name, imported in imports.items()
        for other in imported
        if {name.split(".")[0], other.split(".")[0]} == set(PACKAGES)
        and not (is_part(name, "symgen") and is_part(other, SHARED))
    ]
    assert crossing == []


def test_the_shared_package_knows_no_room(imports: Imports) -> None:
    """Property: what both packages share imports nothing of either, and no NumPy."""
    shared = {name: imported for name, imported in imports.items() if is_part(name, SHARED)}
    assert shared
    others = {other for imported in shared.values() for other in imported}
    tops = {other.split(".")[0] for other in others if not is_part(other, SHARED)}
    assert not tops & {*PACKAGES, "numpy", "scipy"}


@pytest.mark.parametrize("library", LIBRARIES)
def test_libraries_are_imported_in_their_room_only(library: str, imports: Imports) -> None:
    """Property: no build tool at run time; engines, pages and figures in one room each."""
    guilty = [
        name
        for name, imported in imports.items()
        if is_part(name, "runtime")
        and any(is_part(other, library) for other in imported)
        and not any(is_part(name, room) for room in LIBRARIES[library])
    ]
    assert guilty == []


def test_the_graph_sees_imports_of_libraries(imports: Imports) -> None:
    """Property: the test above is of libraries that some module really imports."""
    seen = {other.split(".")[0] for imported in imports.values() for other in imported}
    assert seen >= set(LIBRARIES)


@pytest.mark.parametrize("folder", ["symgen/templates", "generated/fr3"])
def test_headers_include_each_other_one_way(folder: str) -> None:
    """Property: the headers of the C code form no circle; each states what it needs."""
    headers = [*(REPOSITORY / folder).glob("*.h"), *(REPOSITORY / folder).glob("*.h.jinja2")]
    pattern = re.compile(r'^#include "([\w.]+)"', re.MULTILINE)
    included = {
        path.name.removesuffix(".jinja2"): set(pattern.findall(path.read_text(encoding="utf-8")))
        for path in headers
    }
    assert included["sines.h"] == {"lanes.h"}
    assert included["lanes.h"] == set()
    assert floors_of(included) <= MOST_FLOORS


def imported_in(node: ast.AST) -> list[str]:
    """Modules that one import statement names."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module or ""] if isinstance(node, ast.ImportFrom) else []


def late_imports(nodes: Sequence[ast.AST]) -> list[str]:
    """Modules that functions of a module import."""
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    statements = {node for function in functions for node in ast.walk(function)}
    return [name for node in statements for name in imported_in(node)]


def test_functions_import_optional_libraries_only() -> None:
    """Property: optional and slow libraries alone, each in few places; everything else at the top.

    matplotlib, scipy.signal and pooch take 0.3 to 0.8 s, and most commands need none of them.
    """
    late = [
        (name, other) for name, nodes in nodes_of_trees().items() for other in late_imports(nodes)
    ]
    foreign = [pair for pair in late if not pair[1].startswith(OPTIONAL)]
    assert foreign == []
    assert len(late) <= MOST_LATE_IMPORTS


def private_names(nodes: Sequence[ast.AST]) -> set[str]:
    """Private names of other libraries that a module uses: library._name or from library._part."""

    def is_private(part: str) -> bool:
        return part.startswith("_") and not part.startswith("__")

    named: dict[str, str] = {}
    found = set()
    for node in nodes:
        if not isinstance(node, ast.Import | ast.ImportFrom):
            continue
        for alias in node.names:
            module = node.module or "" if isinstance(node, ast.ImportFrom) else alias.name
            own = module.split(".")[0] in PACKAGES
            parts = [*module.split("."), alias.name]
            if not own and any(map(is_private, parts)):
                found.add(".".join(parts))
            if not own:
                named[alias.asname or alias.name.split(".")[0]] = module
    for node in nodes:
        if isinstance(node, ast.Attribute) and is_private(node.attr):
            root: ast.AST = node
            while isinstance(root, ast.Attribute):
                root = root.value
            if isinstance(root, ast.Name) and root.id in named:
                found.add(ast.unparse(node))
    return found


def test_no_private_names_of_libraries() -> None:
    """Property: a release of a library may change what it calls private."""
    assert {
        (m, name) for m, nodes in nodes_of_trees().items() for name in private_names(nodes)
    } == set()


def test_the_process_and_the_import_system_are_left_alone() -> None:
    """Property: no end without clean-up, no settings of the allocator, no replaced modules."""
    pattern = re.compile(
        r"os\._exit|mallopt|sys\.modules\[[^]]+\] *=[^=]|gc\.(?:freeze|disable|set_th)"
    )
    guilty = [path.name for path in MODULES if pattern.search(path.read_text(encoding="utf-8"))]
    assert guilty == []


def test_the_checks_of_imports_can_fail() -> None:
    """Property: a module with all faults is seen."""
    tree = ast.parse(
        "import scipy\nfrom typer import _x\ndef f():\n    import json\n    scipy.a._b\nf = 1\n"
    )
    nodes = [*ast.walk(tree)]
    assert late_imports(nodes) == ["json"]
    assert private_names(nodes) == {"typer._x", "scipy.a._b"}
    assert stated_twice(tree) == {"f"}


def test_modules_are_short() -> None:
    """Property: a module holds one responsibility; longer ones become a folder."""
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert {path: count for path, count in lines.items() if count > LONGEST} == {}


def test_the_95_percent_quantile_has_one_place() -> None:
    """Property: other modules import it; copies had three, seven and sixteen digits."""
    pattern = re.compile(r"[^\w.](?:1\.9(?:6|59\d*)|3\.92|3\.84\d*)\b")
    scripts = sorted((REPOSITORY / "scripts").rglob("*.py"))
    places = {
        path.relative_to(REPOSITORY).as_posix()
        for path in (*MODULES, *scripts)
        for line in path.read_text(encoding="utf-8").splitlines()
        if pattern.search(line) and " σ" not in line
    }
    assert places == {"runtime/estimators/regression/samples.py"}


def test_modules_are_found() -> None:
    """Property: the tests above look at the right folders."""
    names = {path.relative_to(REPOSITORY).as_posix() for path in MODULES}
    assert {"symgen/emit/ssa.py", "runtime/library/library.py"} <= names


def test_the_longest_tests_are_there() -> None:
    """Property: the names by which files of tests come first are names of files."""
    missing = [name for name in FIRST if not (Path(__file__).parent / name).is_file()]
    assert not missing
    assert len(set(FIRST)) == len(FIRST)


def test_run_time_needs_no_build_tool() -> None:
    """Property: loading and computing imports neither symgen nor casadi nor pinocchio."""
    code = (
        "import sys, runtime, runtime.library\n"
        "print([m for m in ('symgen', 'casadi', 'pinocchio', 'mujoco') if m in sys.modules])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "[]"


HELP = "from {} import main; sys.argv = ['symgen', '--help']; main()"
STARTS = ("import runtime", *map(HELP.format, ("symgen.cli.console", "symgen.cli", "runtime.cli")))


@pytest.mark.parametrize("start", STARTS)
def test_start_loads_no_heavy_library(start: str) -> None:
    """Property: libraries of half a second and more are imported where they are used."""
    code = (
        "import atexit, sys\n"
        "names = ('casadi', 'matplotlib', 'mujoco', 'pinocchio', 'scipy.signal')\n"
        f"atexit.register(lambda: print([m for m in names if m in sys.modules]))\n{start}"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert run.stdout.splitlines()[-1] == "[]"


def test_names_of_the_package_exist() -> None:
    """Property: every public name of runtime exists; an unknown one is an AttributeError."""
    code = (
        "import runtime\n"
        "assert all(getattr(runtime, name) is not None for name in runtime.__all__)\n"
        "assert {n for n in dir(runtime) if n[:1] != '_'} == set(runtime.__all__)\n"
        "try:\n    runtime.nothing\nexcept AttributeError as error:\n    print(error)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "module 'runtime' has no attribute 'nothing'"


def test_commands_use_one_thread_of_blas() -> None:
    """Oracle: threadpoolctl; a second thread took four fifths of the time of `predict`."""
    code = (
        "import sys\nfrom runtime.cli import main\nsys.argv = ['symgen', '--version']\ntry:\n    "
        "main()\nexcept SystemExit:\n    pass\nimport numpy\nfrom threadpoolctl import "
        "threadpool_info\nprint(*(pool['num_threads'] for pool in threadpool_info() if "
        "pool['user_api'] == 'blas'))"
    )
    free = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
        env=free,
    )
    assert set(run.stdout.splitlines()[-1].split()) == {"1"}


def test_run_time_names_no_build_tool() -> None:
    """Property: no import of symgen or casadi in runtime, hidden in a function or not."""
    pattern = re.compile(r"^\s*(?:import|from)\s+(?:symgen|casadi)\b", re.MULTILINE)
    guilty = [
        path.relative_to(REPOSITORY).as_posix()
        for path in MODULES
        if path.is_relative_to(REPOSITORY / "runtime")
        and pattern.search(path.read_text(encoding="utf-8"))
    ]
    assert guilty == []


PLAIN_WORDS = {"offset", "load", "position"}
"""Names of friction columns that mean other things, too."""


def test_friction_columns_are_known_by_their_records() -> None:
    """Property: no name of a column is compared with a string outside of its own room."""
    names = {*COLUMNS} - PLAIN_WORDS
    rooms = ("runtime.recording.friction", "runtime.recording.settings")
    guilty = [
        f"{module}:{node.lineno}"
        for module, nodes in nodes_of_trees().items()
        if not any(is_part(module, room) for room in rooms)
        for node in nodes
        if isinstance(node, ast.Compare)
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and part.value in names
    ]
    assert guilty == []
