"""The arm as it is known: parameters and friction, from the URDF or from what identify wrote."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.identification.saved_result import read_result, require_model
from runtime.library import Array, Library
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class ArmModel:
    """Frozen while the payload is found.

    Attributes:
        pi: (10 n,).
        friction: columns and widths.
        phi: their coefficients, (n, k).
        origin: where it comes from, for the report.
    """

    pi: Array
    friction: Friction
    phi: Array
    origin: str


def arm_model(lib: Library) -> ArmModel:
    """The URDF's parameters without friction."""
    return ArmModel(lib.pi0, Friction(()), np.zeros((lib.n_joints, 0)), "the URDF, no friction")


def read_arm_model(path: Path, lib: Library) -> ArmModel:
    """What identify wrote, a folder or its result.json.

    Raises:
        RecordingError: no such result, or one of another robot.
    """
    saved = read_result(path)
    notes = require_model(saved, lib, path)
    origin = "; ".join((f"identified, '{path}'", *notes))
    return ArmModel(saved.pi, saved.friction, saved.phi, origin)
