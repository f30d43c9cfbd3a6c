"""Start-up: which libraries an import loads; heavy ones are imported where they are used."""

import os
import subprocess
import sys

import pytest

from tests.conftest import REPOSITORY

HEAVY = (
    *("scipy.signal", "scipy.stats", "scipy.integrate", "scipy.optimize", "scipy.interpolate"),
    *("scipy.spatial", "scipy.fft", "scipy.sparse", "scipy.linalg", "numpy", "matplotlib"),
    *("scipy.special", "scipy.ndimage", "pydantic"),
    *(
        "jinja2",
        "pooch",
        "pyarrow",
        "mcap",
        "pxr",
        "rosbags",
        "distributed",
        "mujoco",
        "viser",
        "clarabel",
    ),
)
ALLOWED = {
    "import runtime": set(),
    "import runtime.library": {"numpy"},
    "import runtime.recording": {"numpy"},
    "import runtime.identification.single_log": {"numpy", "clarabel"},
    "import runtime.outputs.report.report": {"numpy", "jinja2"},
}
"""Statement → heavy libraries that it may load: what its results need in every case."""


def loaded_by(statement: str) -> set[str]:
    """Heavy libraries and unused modules that a fresh interpreter holds after a statement."""
    known = HEAVY + UNUSED
    code = f"import sys\n{statement}\nprint(*(m for m in {known!r} if m in sys.modules))"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    return set(run.stdout.split())


@pytest.mark.parametrize("statement", ALLOWED)
def test_import_budget(statement: str) -> None:
    """Property: no library beyond those listed; scipy.signal alone takes half a second."""
    # What numpy and clarabel import by themselves is not ours to choose.
    allowed = ALLOWED[statement] | (loaded_by("import clarabel") if ALLOWED[statement] else set())
    assert loaded_by(statement) - allowed == set()


UNUSED = (
    *("concurrent.futures", "rich.status", "rich.progress", "threadpoolctl"),
    *(f"runtime.recording.formats.{name}_format" for name in ("bag", "hdf5", "lerobot")),
    *(f"runtime.estimators.{name}" for name in ("optimizers.adam", "friction_net", "descent.fit")),
    "runtime.identification.current_gains.one_log",
    *("runtime.library.compiled_descent", "runtime.library.compiled_closed_loop"),
)
"""Modules that a short log in a pipe has no use for: threads, signs of progress, other formats and
methods."""


DATA_CLASSES = 58
"""Most data classes of `runtime` that `identify` defines; each compiles its methods, 0.6 ms of CPU
time, a named tuple takes 0.05 ms."""


def test_identification_uses_no_package_of_scipy(tmp_path) -> None:
    """Property: compiled extensions suffice for a fit with its checks, URDF and result file."""
    words = ["symgen", "identify", "fr3_simulated", "--no-report", "--out", str(tmp_path / "out")]
    run = (
        f"import sys; sys.argv = {words!r}\n"
        "from contextlib import redirect_stderr, redirect_stdout\n"
        "from os import devnull\n"
        "from runtime.cli import main\n"
        "with open(devnull, 'w') as f, redirect_stdout(f), redirect_stderr(f):\n"
        "    try:\n        main()\n    except SystemExit as end:\n        assert not end.code\n"
        "data = {c for m in list(sys.modules.values()) for c in vars(m).values()\n"
        "    if '__dataclass_params__' in getattr(c, '__dict__', ())\n"
        "    and c.__module__.startswith('runtime.')}\n"
        f"assert len(data) <= {DATA_CLASSES}, len(data)"
    )
    assert loaded_by(run) - {"numpy", "clarabel"} == set()
    assert (tmp_path / "out/result.json").is_file()


def test_names_of_the_package_are_imported_at_their_first_use() -> None:
    """Property: every public name exists; an unknown one is an AttributeError."""
    code = (
        "import runtime\n"
        "assert all(getattr(runtime, name) is not None for name in runtime.__all__)\n"
        "assert set(runtime.__all__) <= set(dir(runtime))\n"
        "try:\n    runtime.nothing\nexcept AttributeError as error:\n    print(error)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "module 'runtime' has no attribute 'nothing'"


def test_commands_use_one_thread_of_blas() -> None:
    """Oracle: threadpoolctl; a second thread took four fifths of the time of `predict`."""
    code = (
        "import sys\nfrom runtime.cli import main\nsys.argv = ['symgen', '--version']\nmain()\n"
        "import numpy\n"
        "from threadpoolctl import threadpool_info\n"
        "print(*(pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'))"
    )
    free = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
        env=free,
    )
    assert set(run.stdout.splitlines()[-1].split()) == {"1"}


def test_collector_does_not_search_modules() -> None:
    """Property: what a command imports is outside the collector, which still runs afterwards."""
    code = (
        "import gc, sys\nfrom runtime.cli import main\nsys.argv = ['symgen', 'identify', '-h']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print(gc.get_freeze_count(), len(gc.get_objects()), gc.isenabled())"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    frozen, searched, enabled = run.stdout.splitlines()[-1].split()
    # The modules of a command hold some 66,000 containers, its help text 5,000.
    assert int(frozen) > int(searched)
    assert enabled == "True"


def test_collector_waits_until_a_command_is_imported() -> None:
    """Property: no search while modules are imported; Python's own number makes thirty of them."""
    code = (
        "import atexit, gc, runpy, sys\nsys.argv = ['symgen', 'identify', '-h']\n"
        "searches = lambda: sum(each['collections'] for each in gc.get_stats())\n"
        "before = searches()\natexit.register(lambda: print(searches() - before))\n"
        "runpy.run_module('runtime', run_name='__main__')"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert int(run.stdout.splitlines()[-1]) <= 3  # for the help text
