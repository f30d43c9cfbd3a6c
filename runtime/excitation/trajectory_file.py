"""A designed trajectory as JSON: robot, home, coefficients, duration and what is known of it."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of, write_json
from runtime.errors import IdentificationError, RecordingError
from runtime.excitation.motion import trajectory as motions
from runtime.excitation.search.design import Design
from runtime.excitation.search.design_settings import LONGEST
from runtime.excitation.search.prediction import Prediction
from runtime.library import Library

LARGEST_NUMBER = 1e6  # largest number of a trajectory that is read, in SI units


def write_trajectory(
    designed: Design,
    lib: Library,
    path: Path,
    prediction: Prediction | None = None,
    ways: Mapping[str, motions.Trajectory] | None = None,
    further: Mapping[str, Any] | None = None,
) -> None:
    """Write a design and its predicted accuracy, atomically."""
    known = {
        "condition_number": designed.condition,
        "condition_numbers_of_starts": list(designed.conditions),
        "condition_numbers_of_relatives": list(designed.variations),
        "criterion": designed.criterion,
        "criterion_of_starts": list(designed.values),
        "use_of_limits": designed.use,
        "assumptions": list(designed.assumptions),
        **(further or {}),
    }
    if prediction is not None:
        known["prediction"] = facts(prediction)
    write_motion(designed.trajectory, lib, path, known, ways)


def write_motion(
    trajectory: motions.Trajectory,
    lib: Library,
    path: Path,
    known: dict[str, Any] | None = None,
    ways: Mapping[str, motions.Trajectory] | None = None,
) -> None:
    """Write a trajectory and further facts, atomically."""
    facts = {
        "robot": lib.name,
        "joints": list(lib.joint_names),
        **_facts(trajectory),
        **(known or {}),
        **{name: _facts(way) for name, way in (ways or {}).items()},
    }
    write_json(path, facts, allow_nan=True)


def _facts(trajectory: motions.Trajectory) -> dict[str, Any]:
    basis = trajectory.basis
    return {
        "basis": basis.equation,
        "basis_name": basis.name,
        "zero_jerk_at_ends": basis.zero_jerk,
        "duration": trajectory.duration,
        "home": trajectory.home.tolist(),
        "coefficients": trajectory.coefficients.tolist(),
    }


def read_session(path: Path, lib: Library) -> motions.JoinedMotion:
    """Read a motion with the ways to its start and back that its file holds."""
    motion = read_trajectory(path, lib)
    facts = json_of(path)
    approach, back = (
        _trajectory(facts[name], facts["joints"], path, lib) if name in facts else None
        for name in motions.WAYS
    )
    return motions.joined(approach, motion, back)


def read_trajectory(path: Path, lib: Library) -> motions.Trajectory:
    """Read a trajectory of this robot; a file without the name of a basis has cosines."""
    try:
        facts = json_of(path)
        joints = facts["joints"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise _no_trajectory(path, error) from None
    return _trajectory(facts, joints, path, lib)


def _no_trajectory(path: Path, error: Exception) -> RecordingError:
    return RecordingError(
        f"'{path}' is not a trajectory ({type(error).__name__}); make one with: "
        "python -m runtime excite"
    )


def _trajectory(facts: Any, joints: object, path: Path, lib: Library) -> motions.Trajectory:
    """A trajectory of a file, checked against its robot."""
    try:
        trajectory = motions.Trajectory(
            np.array(facts["home"], dtype=float),
            np.array(facts["coefficients"], dtype=float),
            float(facts["duration"]),
            motions.basis_of(
                facts.get("basis_name", motions.COSINE.name), facts.get("zero_jerk_at_ends") is True
            ),
        )
    except IdentificationError as error:
        raise RecordingError(f"the trajectory '{path}' cannot be read: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _no_trajectory(path, error) from None
    n = lib.n_joints
    shape = trajectory.coefficients.shape
    fits = trajectory.home.shape == (n,) and len(shape) == 2 and shape[0] == n
    if joints != list(lib.joint_names) or not fits or not trajectory.coefficients.size:
        raise RecordingError(f"the trajectory '{path}' belongs to another robot than '{lib.name}'")
    if shape[1] % trajectory.basis.size(1):
        raise RecordingError(
            f"the trajectory '{path}' has {shape[1]} coefficients per joint, its basis "
            f"'{trajectory.basis.name}' takes pairs of coefficients; make one with: "
            "python -m runtime excite"
        )
    numbers = [*trajectory.home, *trajectory.coefficients.ravel(), trajectory.duration]
    if not (np.abs(numbers) < LARGEST_NUMBER).all() or not 0 < trajectory.duration <= LONGEST:
        raise RecordingError(
            f"the trajectory '{path}' holds numbers beyond {LARGEST_NUMBER:g} or not finite, or a "
            f"duration that is not positive or beyond {LONGEST:g} s; make one with: "
            "python -m runtime excite"
        )
    return trajectory


def facts(prediction: Prediction) -> dict[str, object]:
    """The prediction as a JSON object."""

    def numbers(values: Iterable[float] | None) -> list[float] | None:
        return None if values is None else [float(value) for value in values]

    known = prediction.known
    return {
        "torque_noise": numbers(known.noise),
        "rate_hz": known.rate,
        "earlier_logs_count": known.earlier is not None,
        "unknowns": "payload" if prediction.payload_only else "base parameters",
        **({"left_out": list(known.left_out)} if known.left_out else {}),
        "criteria": [
            {
                "samples": score.samples,
                "columns": score.columns,
                "friction": list(score.friction),
                "condition_number_of_unit_columns": score.condition,
                "relative_error": score.relative_error,
                "torque_error": score.torque_error,
                "half_axis": score.half_axis,
            }
            for score in prediction.scores
        ],
        "sigma": numbers(prediction.sigma),
        "sigma_with_friction": numbers(prediction.sigma_with_friction),
        "sigma_of_torque_per_joint": numbers(prediction.torque),
        "sigma_of_payload_mass": prediction.payload_mass,
        "sigma_of_payload_com": numbers(prediction.payload_com),
        "notes": list(prediction.notes),
    }
