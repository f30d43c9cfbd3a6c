"""Ground of the monitoring tests: an identified real arm, its log from 60 % on, a virtual fleet."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from runtime import Identification, Recording, write_recording
from runtime.excitation import Trajectory
from runtime.identification.posterior_file import SavedPosterior, read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import SavedResult, read_result
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.monitoring.fleet.gather import unit_of
from runtime.recording import Friction, Preparation
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed
from tests.runtime.monitoring.later_logs import FRICTION, NOISE
from tests.runtime.monitoring.virtual_units import SPREAD, UNITS, Fleet, statistics_about


@dataclass(frozen=True, slots=True)
class Monitored:
    """A result in a folder, with its posterior."""

    folder: Path
    result: Identification
    saved: SavedResult
    posterior: SavedPosterior


@pytest.fixture(scope="session")
def monitored(
    panda: Recording, lib: Library, tmp_path_factory: pytest.TempPathFactory
) -> Monitored:
    """The Panda identified from its first 60 %, tested on the rest."""
    folder = tmp_path_factory.mktemp("monitored")
    result = identify_recording(panda, lib)
    write_result(result, folder, "python -m runtime identify panda_gaz")
    saved = read_result(folder)
    return Monitored(folder, result, saved, read_posterior(folder, saved, lib))


@pytest.fixture(scope="session")
def rest_of_log(panda: Recording) -> Recording:
    """The log from 60 % on, as it was recorded: repeated rows and a clock that jitters."""
    start = panda.t[0] + 0.6 * panda.duration
    return panda.take(panda.t >= start, "the rest").replace(recipe=None)


@pytest.fixture(scope="session")
def rest_file(rest_of_log: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a file."""
    path = tmp_path_factory.mktemp("rest") / "rest.npz"
    write_recording(rest_of_log, path)
    return path


@pytest.fixture(scope="session")
def arm(
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """A simulated arm, identified from one motion."""
    plant = Plant(pi_true, **FRICTION, torque_noise=NOISE)
    log = ideal(lib, trajectories[0], plant, rng=np.random.default_rng(1))
    terms = Friction(("viscous", "coulomb", "offset"), 0.03)
    folder = tmp_path_factory.mktemp("arm")
    result = identify_recording(log, lib, friction=terms, preparation=Preparation())
    write_result(result, folder, "test")
    return folder


@pytest.fixture(scope="session")
def fleet_motion(lib: Library, trajectories: tuple[Trajectory, ...]) -> Recording:
    """The training motion at 25 Hz."""
    return ideal(lib, trajectories[0], Plant(lib.pi0), rate_hz=25.0)


@pytest.fixture(scope="session")
def fleet(lib: Library, fleet_motion: Recording) -> Fleet:
    """20 units that differ by 5 % about a type that is 20 % off the URDF."""
    rng = np.random.default_rng(2)
    centre = perturbed(lib, lib.pi0, 0.2, rng)
    pi = tuple(perturbed(lib, centre, SPREAD, rng) for _ in range(UNITS))
    known = tuple(
        statistics_about(lib, fleet_motion, each, f"u{k:02d}", rng) for k, each in enumerate(pi)
    )
    return Fleet(centre, pi, known, tuple(unit_of(each, lib, each.unit) for each in known))
