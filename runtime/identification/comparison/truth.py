"""The robot that a simulated log was made of, from the file that `simulate` writes beside it."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.files import bytes_of, json_of
from runtime.library import Array, Library

SUFFIX = ".truth.json"


@dataclass(frozen=True, slots=True)
class Truth:
    """True base parameters (n_b,), and the file they come from."""

    beta: Array
    name: str
    sha256: str


def beside(log: str) -> Path | None:
    """LOG.truth.json, where a log file has one."""
    path = Path(log).with_suffix(SUFFIX)
    return path if Path(log).is_file() and path.is_file() else None


def read_truth(path: Path, lib: Library) -> Truth:
    """Read the parameters that `simulate` has written.

    Raises:
        RecordingError: not such a file, or of another robot.
    """
    try:
        data = bytes_of(path)
        facts = json_of(data)
        pi, robot = np.array(facts["pi"], dtype=float), facts.get("robot", lib.name)
        if pi.shape != lib.pi0.shape or not np.isfinite(pi).all() or robot != lib.name:
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise RecordingError(
            f"'{path}' is no truth of '{lib.name}'; expected JSON with {lib.pi0.size} numbers 'pi' "
            "as simulate writes it, so correct it, name another with --truth, or move it away"
        ) from None
    return Truth(lib.base_matrix @ pi, path.name, hashlib.sha256(data).hexdigest())
