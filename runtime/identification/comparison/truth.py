"""True parameters of a simulated log, from the file that `simulate` writes beside it."""

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
    """True base parameters.

    Attributes:
        beta: (n_b,) SI.
        name: name of their file.
        sha256: digest of its bytes.
    """

    beta: Array
    name: str
    sha256: str


def beside(log: str) -> Path | None:
    """Path of LOG.truth.json, None where the log has none."""
    path = Path(log).with_suffix(SUFFIX)
    return path if Path(log).is_file() and path.is_file() else None


def read_truth(path: Path, lib: Library) -> Truth:
    """Read the parameters that `simulate` has written.

    Args:
        path: a .truth.json.
        lib: library of the robot.

    Returns:
        The true base parameters.

    Raises:
        RecordingError: the file is damaged, or of another robot.
    """
    try:
        data = bytes_of(path)
        facts = json_of(data)
        pi, robot = np.array(facts["pi"], dtype=float), facts.get("robot", lib.name)
        if pi.shape != lib.pi0.shape or not np.isfinite(pi).all() or robot != lib.name:
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise RecordingError(
            f"expected a JSON with {lib.pi0.size} numbers 'pi' of '{lib.name}', as simulate writes "
            f"it, got '{path}'; correct it, name another with --truth, or move it away"
        ) from None
    return Truth(lib.base_matrix @ pi, path.name, hashlib.sha256(data).hexdigest())
