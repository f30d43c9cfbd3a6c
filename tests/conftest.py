"""Shared ground of the tests: data outside the repository, robots built once per session.

`SYMGEN_DATA` names the folder with published URDFs and logs, by default `shared` beside the
repository. Tests that need it are skipped with a reason where it is absent.
"""

import functools
import gc
import importlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings
from markupsafe import Markup
from threadpoolctl import ThreadpoolController

from runtime.common import commands, threads
from runtime.common.user_builds import records_folder
from runtime.library import Library, load
from runtime.recording.preprocessing import filters
from symgen.chain import ChainOptions
from symgen.make.pipeline import build, is_current
from symgen.make.request import BuildRequest, bundled_request
from tests.robots import CASES, DATA, ONE_LEVEL

REPOSITORY = Path(__file__).parents[1]

FIRST = (
    "symgen/mechanics/test_dynamics.py",
    "runtime/test_combinations.py",
    "test_readme.py",
    "runtime/identification/test_random_runs.py",
    "test_docs.py",
    "test_fuzz.py",
    "symgen/test_memory.py",
    "runtime/identification/drive/test_drive.py",
    "runtime/inspection/test_faulty_logs.py",
    "runtime/inspection/test_inspection_signals.py",
    "runtime/experiments/test_experiments.py",
    "runtime/inspection/test_inspection_files.py",
    "runtime/inspection/test_bare_files.py",
    "runtime/identification/sensor_gains/test_sensor_gains.py",
    "runtime/tapes/test_jax.py",
    "runtime/recording/friction/test_law_gain.py",
    "test_bench.py",
    "runtime/estimators/test_contradictions.py",
    "runtime/excitation/test_way.py",
    "runtime/campaign/test_campaign.py",
    "attacks/test_extremes.py",
    "test_console.py",
    "runtime/cli/test_cli.py",
    "runtime/identification/payload/test_payload.py",
    "runtime/excitation/search/test_variations.py",
    "runtime/estimators/test_estimate_error.py",
    "runtime/identification/comparison/test_compare.py",
    "symgen/make/test_build_processes.py",
    "test_packages.py",
    "runtime/inspection/test_inspection.py",
    "runtime/experiments/test_experiments_cluster.py",
    "runtime/identification/long_logs/test_long_logs.py",
    "runtime/cli/test_advised_commands.py",
    "test_tutorials.py",
    "runtime/campaign/test_kills.py",
    "runtime/experiments/test_experiments_run.py",
    "runtime/recording/friction/test_warming.py",
    "runtime/excitation/search/test_interrupted_designs.py",
)
"""Files of eight seconds and more from the longest on, behind the one that builds most robots."""

PAGES = "report"
"""Folder of the tests of pages."""
PICTURES = ("report.torques", "report.mass_change", "comparison.method_bars")
"""Pictures of pages of results that are drawn in the tests of pages alone."""


def pytest_collection(session: pytest.Session) -> None:
    """A worker imports its share of the test files first, and the others' as these compiled them.

    Rewriting the assertions of all files takes 5 s of CPU, and all workers need the same ones.
    """
    gc.disable()  # modules and tests stay: passing over them again takes a fifth of the collection
    worker = getattr(session.config, "workerinput", None)
    if worker is None or session.config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    names = sorted(
        ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
        for path in Path(__file__).parent.rglob("test_*.py")
    )
    for name in names[int(worker["workerid"].removeprefix("gw")) :: worker["workercount"]]:
        with suppress(Exception, pytest.skip.Exception):  # pytest imports it again and reports it
            importlib.import_module(name)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first: of several workers none is left alone with one at the end."""
    place = {Path(__file__).parent / name: k for k, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(item.path, len(FIRST)))


def pytest_collection_finish() -> None:
    """Modules and tests stay to the end: the collector of cycles need not pass over them again.

    It passes seldom, since jax and hypothesis have functions that are called at every pass.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 50, 50)
    gc.enable()


# Derandomised: the same commit passes or fails the same way everywhere.
settings.register_profile("tests", max_examples=60, deadline=None, derandomize=True, database=None)
settings.load_profile("tests")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of published URDFs (`models`) and logs (`data`); skips where there is none."""
    folder = Path(os.environ.get("SYMGEN_DATA", REPOSITORY.parent / "shared"))
    if not (folder / "models").is_dir():
        pytest.skip(
            f"no test data in '{folder}'; set SYMGEN_DATA to the folder with models/ and data/"
        )
    return folder


@pytest.fixture(scope="session", autouse=True)
def _zig_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """One folder for what zig compiles of its own before its first program, 15 s of CPU.

    The workers of pytest-xdist share it, as they share the builds.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "zig"
    os.environ.setdefault("ZIG_GLOBAL_CACHE_DIR", str(folder))


@pytest.fixture(scope="session", autouse=True)
def _no_wait_for_the_disk() -> Iterator[None]:
    """No test pulls the plug: the order of writing is tested, not the disk behind it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _made_once() -> Iterator[None]:
    """What a user's process makes once and this one would make thousands of times, 5 to 20 ms each.

    These are the parsers of commands, designs of filters, and the search for BLAS libraries, whose
    limit `tests/test_architecture.py` examines in a process of its own.
    """
    design, blas = functools.cache(filters.butterworth_sections), ThreadpoolController()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(commands, "imported", functools.cache(commands.imported))
        patch.setattr(filters, "butterworth_sections", lambda *given: design(*given).copy())
        patch.setattr(threads, "threadpool_limits", blas.limit)
        yield


@pytest.fixture(scope="session", autouse=True)
def _own_builds(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Records of builds of this run; what was recorded before counts, and nothing is added to it.

    The workers of pytest-xdist share it, as they share the builds.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "builds"
    if folder != records_folder():
        known = records_folder()
        folder.mkdir(mode=0o700, exist_ok=True)
        for path in known.glob("*.json"):
            shutil.copy(path, folder)
        os.environ["SYMGEN_BUILDS"] = str(folder)


@pytest.fixture(scope="session")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The `generated` folder of this run; tests read it and never write it.

    The workers of pytest-xdist share it: `build` lets one of them compile and the others wait.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "generated"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def fr3(root: Path) -> Library:
    """The bundled Franka Research 3 as the sources of this commit make it.

    A library that `symgen build` has just made of them is taken as it is: it is the very same.
    """
    request, made = bundled_request("fr3"), REPOSITORY / "generated" / "fr3"
    if is_current(request, made, levels=()):
        return load(made)
    return load(build(request, root).folder)


@pytest.fixture(scope="session")
def robot(root: Path, request: pytest.FixtureRequest) -> Callable[[str], Library]:
    """Build (once) and load `fr3` or a robot of `tests.robots.CASES`."""
    loaded: dict[str, Library] = {}

    def get(name: str) -> Library:
        if name == "fr3":
            loaded[name] = request.getfixturevalue("fr3")
        elif name not in loaded:
            case = CASES[name]
            models = None
            if case.published:
                models = request.getfixturevalue("shared_data") / "models"
            # Those of one level get the best that this processor runs.
            levels = () if case.every_level else (request.getfixturevalue("fr3").level,)
            loaded[name] = load(build(case.request(name, models), root, levels=levels).folder)
        return loaded[name]

    return get


@pytest.fixture(scope="session")
def hopper(root: Path) -> Library:
    """A torso that falls freely, with two legs."""
    text = (DATA / "hopper.urdf").read_text()
    request = BuildRequest("hopper", text, ChainOptions(floating=True))
    return load(build(request, root, levels=ONE_LEVEL).folder)


TINY_URDF = """<robot name="tiny">
  <link name="base"/>
  <joint name="swing" type="revolute">
    <origin xyz="0 0 0.5"/><parent link="base"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" velocity="3" effort="10"/>
  </joint>
  <link name="rod"><inertial><origin xyz="0.1 0 0.2"/><mass value="1.5"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
</robot>
"""


@pytest.fixture(scope="session")
def tiny_request() -> BuildRequest:
    """A pendulum, the smallest robot, named `tiny`."""
    return BuildRequest("tiny", TINY_URDF)


@pytest.fixture(scope="session")
def tiny_built(root: Path, tiny_request: BuildRequest) -> Path:
    """The folder of the pendulum; not to be written, `tiny` is a copy."""
    return build(tiny_request, root).folder


@pytest.fixture
def tiny(tiny_built: Path, tmp_path: Path) -> Path:
    """A fresh copy of the built pendulum in tmp_path/out/tiny, free to be damaged."""
    return Path(shutil.copytree(tiny_built, tmp_path / "out" / "tiny"))


@pytest.fixture(autouse=True)
def _pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """No curves outside the tests of pages: drawing takes most of the time of a command.

    A test that looks at a picture asks for `drawn`.
    """
    if "undrawn" in request.fixturenames or not (
        "drawn" in request.fixturenames or PAGES in request.path.parts
    ):
        for name in PICTURES:
            monkeypatch.setattr(f"runtime.outputs.report.{name}", lambda *_, **__: Markup("<svg/>"))
        monkeypatch.setattr(
            "runtime.cli.observe.draw_external_torque", lambda *given: given[-1].write_bytes(b"")
        )


@pytest.fixture
def drawn() -> None:
    """Pages of results and pictures of observers with their curves."""


@pytest.fixture
def undrawn() -> None:
    """Pages of results without curves, in a test of their words."""
