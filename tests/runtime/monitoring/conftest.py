"""Ground of the monitoring tests: an identified real arm, and its log from 60 % on."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from runtime import Identification, Recording, identify, write_recording
from runtime.identification.posterior_file import Posterior, read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import SavedResult, read_result
from runtime.library import Library


@dataclass(frozen=True, slots=True)
class Monitored:
    """A result in a folder, with its posterior."""

    folder: Path
    result: Identification
    saved: SavedResult
    posterior: Posterior


@pytest.fixture(scope="session")
def monitored(
    panda: Recording, lib: Library, tmp_path_factory: pytest.TempPathFactory
) -> Monitored:
    """The Panda identified from its first 60 %, tested on the rest."""
    folder = tmp_path_factory.mktemp("monitored")
    result = identify(panda, lib)
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
