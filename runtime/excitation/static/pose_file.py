"""Files of poses at rest: JSON with all facts, and CSV with one row per visit."""

import json

import numpy as np

from runtime.excitation.static.pose_design import PoseDesign
from runtime.library import Library

SIDES = {"below": -1.0, "above": 1.0}
"""Side from which all joints reach a pose, and the sign of the start of that approach."""


def pose_json(designed: PoseDesign, lib: Library) -> bytes:
    """JSON document of the poses."""
    names = lib.joint_names
    facts = {
        "robot": lib.name,
        "joints": list(names),
        "poses": designed.poses.tolist(),
        "approach": dict(zip(names, designed.approach.tolist(), strict=True)),
        "gravity_parameters": len(designed.columns),
        "sigma_parameters": designed.sigma,
        "sigma_parameters_random": _finite(designed.sigma_random),
        "sigma_torque": designed.torque,
        "sigma_torque_random": _finite(designed.torque_random),
        "assumptions": list(designed.assumptions),
    }
    return (json.dumps(facts, indent=1) + "\n").encode()


def pose_table(designed: PoseDesign, lib: Library) -> bytes:
    """CSV with two rows per pose: from below and from above.

    Columns: pose (from 0), side, the start of the approach per joint, the pose per joint [rad, m].
    """
    names = lib.joint_names
    lines = [",".join(["pose", "side", *(f"{name}_start" for name in names), *names])]
    for k, q in enumerate(designed.poses):
        for side, sign in SIDES.items():
            numbers = np.concatenate([q + sign * designed.approach, q])
            lines.append(",".join([str(k), side, *(f"{value:.9g}" for value in numbers)]))
    return ("\n".join(lines) + "\n").encode()


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
