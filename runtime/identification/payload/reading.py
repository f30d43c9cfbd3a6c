"""Known model of the arm: parameters and friction, from the URDF or a result of identify."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.identification.saved_result import read_result, require_model
from runtime.library import Array, Library
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class ArmModel:
    """Parameters and friction of the arm, fixed while the payload is identified.

    Attributes:
        pi: standard parameters, (10 n,).
        friction: friction columns and widths.
        phi: friction coefficients, (n, k).
        origin: source of the model, for the report.
        is_exact: no error of the model enters the intervals of a payload; for simulated arms.
    """

    pi: Array
    friction: Friction
    phi: Array
    origin: str
    is_exact: bool = False


def arm_model(lib: Library) -> ArmModel:
    """The URDF's parameters without friction."""
    return ArmModel(lib.pi0, Friction(()), np.zeros((lib.n_joints, 0)), "the URDF, no friction")


def read_arm_model(path: Path, lib: Library) -> ArmModel:
    """Read the arm from a result of identify.

    Args:
        path: folder of the result, or its result.json.
        lib: library of the robot.

    Returns:
        Parameters and friction.

    Raises:
        RecordingError: the result is missing, damaged, or of another robot.
    """
    saved = read_result(path)
    notes = require_model(saved, lib, path)
    origin = "; ".join((f"identified, '{path}'", *notes))
    return ArmModel(saved.pi, saved.friction, saved.phi, origin)
