"""The arm as it is known: parameters and friction, from the URDF or from what identify wrote."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.documents import json_of
from runtime.errors import RecordingError
from runtime.library import Array, Library
from runtime.recording import Friction

LARGEST = 1e9
"""SI units; what no arm has, NaN included, is no result."""


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
    file = path / "result.json" if path.is_dir() else path
    n = lib.n_joints
    try:
        facts = dict(json_of(file))
        terms = facts["friction"] or {"columns": [], "values": [[]] * n}
        pi, phi = np.array(facts["pi"], dtype=float), np.array(terms["values"], dtype=float)
        friction = Friction.from_facts(terms)
        joints, robot = list(facts["joints"]), str(facts["robot"])
        if pi.shape != (10 * len(joints),) or phi.shape != (len(joints), len(friction.columns)):
            raise ValueError
        if not (np.abs(np.concatenate([pi, phi.ravel()])) < LARGEST).all():
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise RecordingError(
            f"'{path}' holds no valid result.json; give the folder that identify wrote, or its file"
        ) from None
    if joints != list(lib.joint_names):
        raise RecordingError(
            f"'{path}' identified {robot}, whose joints differ from those of '{lib.name}'; "
            "name its robot with --robot"
        )
    return ArmModel(pi, friction, phi, f"identified, '{path}'")
