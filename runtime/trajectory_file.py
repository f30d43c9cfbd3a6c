"""A designed trajectory as JSON: robot, home, coefficients, duration and what is known of it."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from runtime.atomic import replacing
from runtime.errors import RecordingError
from runtime.excitation import Design, Trajectory
from runtime.library import Library


def write_trajectory(found: Design, lib: Library, path: Path) -> None:
    """Write a design, atomically."""
    known = {
        "condition_number": found.condition,
        "condition_numbers_of_starts": list(found.conditions),
        "use_of_limits": found.use,
        "assumptions": list(found.assumptions),
    }
    write_motion(found.trajectory, lib, path, known)


def write_motion(
    trajectory: Trajectory, lib: Library, path: Path, known: dict[str, Any] | None = None
) -> None:
    """Write a trajectory and what is known of it, atomically."""
    facts = {
        "robot": lib.name,
        "joints": list(lib.joint_names),
        "basis": "q = home + sum_m a_m (cos 2 pi m s - 1 + 2 pi^2 m^2 s^2 (1-s)^2), s = t/t_f",
        "duration": trajectory.duration,
        "home": trajectory.home.tolist(),
        "coefficients": trajectory.coefficients.tolist(),
        **(known or {}),
    }
    with replacing(path) as file:
        file.write((json.dumps(facts, indent=1) + "\n").encode())


def read_trajectory(path: Path, lib: Library) -> Trajectory:
    """Read a trajectory of this robot.

    Raises:
        RecordingError: not such a file, or of another robot.
    """
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
        joints = facts["joints"]
        trajectory = Trajectory(
            np.array(facts["home"], dtype=float),
            np.array(facts["coefficients"], dtype=float),
            float(facts["duration"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RecordingError(
            f"'{path}' is no trajectory ({type(error).__name__}); make one with: "
            "python -m runtime excite"
        ) from None
    n = lib.n_joints
    shape = trajectory.coefficients.shape
    fits = trajectory.home.shape == (n,) and len(shape) == 2 and shape[0] == n
    if joints != list(lib.joint_names) or not fits or not trajectory.coefficients.size:
        raise RecordingError(f"the trajectory '{path}' belongs to another robot than '{lib.name}'")
    numbers = [*trajectory.home, *trajectory.coefficients.ravel(), trajectory.duration]
    if not np.isfinite(numbers).all() or not trajectory.duration > 0:
        raise RecordingError(
            f"the trajectory '{path}' holds values that are not finite, or a duration that is not "
            "positive; make one with: python -m runtime excite"
        )
    return trajectory
