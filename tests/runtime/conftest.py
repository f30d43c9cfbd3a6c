"""Ground of the run-time tests: the FR3, the document's trajectories, one real log, the CLI."""

import ctypes
import json
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from runtime import Identification, Recording, read_recording, write_recording
from runtime.cli import main
from runtime.excitation import Trajectory
from runtime.excitation.search.design import Design, write_trajectory
from runtime.excitation.search.information import FRICTION
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    motion_samples_of,
    planned_recording,
)
from runtime.identification.single_log import identify_recording
from runtime.library import Library, load
from runtime.recording import Friction
from runtime.simulation import Plant, ideal
from symgen.chain import ChainOptions
from symgen.make.compiler import levels_of_processor
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import DATA, ONE_LEVEL
from tests.runtime.desk import Desk
from tests.runtime.diagnosis import EXAMPLE
from tests.runtime.exporting import ARM
from tests.runtime.trials import T

# Link 7 of the document's "true" robot: twice the mass and the inertia of the URDF's, at full
# precision (the document's Table B.4 is rounded twice).
PI7_TRUE = np.array(
    [
        *(1.2542865724, 5.6726134989e-3, 1.0819716922e-2, -2.0273441638e-2, 9.4286696773e-4),
        *(8.0771244614e-4, 3.3885162663e-4, -9.7599036040e-5, 1.8297790402e-4, 3.4976400656e-4),
    ]
)


@pytest.fixture(scope="session", autouse=True)
def _one_blas_thread() -> None:
    """Small matrices on busy cores: OpenBLAS threads that wait for each other cost 50 times more.

    Results do not depend on it; numpy and scipy each bring their own copy of the library.
    """
    maps = Path("/proc/self/maps")
    import scipy.linalg  # loads scipy's copy  # noqa: F401

    if not maps.exists():
        return
    for path in set(re.findall(r"/\S*openblas\S*", maps.read_text())):
        for name in ("scipy_openblas_set_num_threads64_", "scipy_openblas_set_num_threads"):
            with suppress(OSError, AttributeError):
                getattr(ctypes.CDLL(path), name)(1)


@pytest.fixture(scope="session")
def lib(fr3: Library) -> Library:
    """The FR3, built for this session."""
    return fr3


@pytest.fixture(scope="session")
def trajectories(lib: Library) -> tuple[Trajectory, ...]:
    """Training, validation and test trajectory: the best three of 60 designs."""
    facts = json.loads((DATA / "fr3_excitation.json").read_text())
    return tuple(
        Trajectory(lib.home, np.array(entry["coefficients"]), facts["duration"])
        for entry in facts["trajectories"]
    )


@pytest.fixture(scope="session")
def pi_true(lib: Library) -> np.ndarray:
    """The document's true robot."""
    return np.concatenate([lib.pi0[:-10], PI7_TRUE])


@pytest.fixture(scope="session")
def ideal_runs(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> tuple[Recording, ...]:
    """The three trajectories at 100 Hz without noise (document Sec. 5.1.1)."""
    return tuple(
        ideal(lib, trajectory, Plant(pi_true)).replace(name=name)
        for trajectory, name in zip(trajectories, ("train", "validation", "test"), strict=True)
    )


@pytest.fixture(scope="session")
def noisy(lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray) -> Recording:
    """The training trajectory with friction and 0.05 N·m of torque noise."""
    plant = Plant(pi_true, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    return ideal(lib, trajectories[0], plant, rng=np.random.default_rng(7))


@pytest.fixture(scope="session")
def panda(shared_data: Path) -> Recording:
    """A real log of a Franka arm with link-side torque."""
    return read_recording(shared_data / "data" / "panda_gaz")


@pytest.fixture(scope="session")
def panda_adam(panda: Recording, lib: Library) -> Identification:
    """The real log identified by the descent in λ."""
    return identify_recording(panda, lib, "adam")


@pytest.fixture(scope="session")
def log(noisy: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The noisy run as a file; nobody writes into its folder."""
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_recording(noisy, path)
    return path


@pytest.fixture(scope="session")
def clean() -> Recording:
    """The bundled simulated log, without any trap."""
    return read_recording(EXAMPLE)


@pytest.fixture
def saved(tmp_path: Path):
    """Writes arrays as the default NPZ; None leaves one out."""

    def save(clean: Recording, name: str = "log.npz", **changes: np.ndarray | None) -> Path:
        arrays = {key: getattr(clean, key) for key in ("t", "q", "dq", "tau")} | changes
        present = {key: values for key, values in arrays.items() if values is not None}
        np.savez(tmp_path / name, **present)
        return tmp_path / name

    return save


@pytest.fixture(scope="session")
def arm(root: Path) -> Library:
    """The arm with every trap of an export."""
    request = BuildRequest("arm", ARM, ChainOptions(gravity=(1.5, -3.0, 9.0)))
    return load(build(request, root, levels=ONE_LEVEL).folder)


@pytest.fixture(scope="session")
def double(root: Path) -> Library:
    """An arm of two joints, the second turns without end; its vectors are short or long."""
    request = BuildRequest("double", (DATA / "double.urdf").read_text())
    return load(build(request, root, levels=levels_of_processor()).folder)


@pytest.fixture(scope="session")
def any_robot(
    request: pytest.FixtureRequest, robot: Callable[[str], Library], tiny_built: Path
) -> Callable[[str], Library]:
    """A robot by name, `tiny` and `double` included, which build fast."""

    def get(name: str) -> Library:
        if name == "double":
            return request.getfixturevalue(name)
        return load(tiny_built) if name == "tiny" else robot(name)

    return get


@dataclass(frozen=True, slots=True)
class Ran:
    """What one command did."""

    code: int
    out: str
    err: str


Command = Callable[..., Ran]


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Command:
    """`python -m runtime …` in this process, from the folder tmp_path."""

    def run(*words: object) -> Ran:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["runtime", *map(str, words)])
        capsys.readouterr()
        code: object = 0
        try:
            main()
        except SystemExit as exit_:
            code = exit_.code
        out, err = capsys.readouterr()
        assert code is None or isinstance(code, int)
        return Ran(code or 0, out, err)

    return run


@pytest.fixture
def desk(
    lib: Library,
    noisy: Recording,
    trajectories: tuple[Trajectory, ...],
    tiny_built: Path,
    tmp_path: Path,
) -> Desk:
    """Good files in tmp_path, from which commands with bad input start."""
    log = noisy.take(slice(0, 400), "short")
    write_recording(log, tmp_path / "good.csv")
    write_recording(log, tmp_path / "good.npz")
    write_trajectory(Design(trajectories[0], 4.9, (4.9,), {}, ()), lib, tmp_path / "good.json")
    (tmp_path / "file").write_text("in the way")
    return Desk(tmp_path, log, lib, load(tiny_built))


@pytest.fixture(scope="module")
def moved(lib: Library, trajectories: tuple[Trajectory, ...]) -> MotionSamples:
    """The training trajectory at 100 Hz, nothing measured."""
    return motion_samples_of(
        planned_recording(trajectories[0], T, lib, "train"), lib, None, Friction(FRICTION)
    )
