"""Limits that a certificate does not check: not stated by the robot, or not requested."""

import numpy as np

from runtime.excitation.limits.safety import Safety
from runtime.library import Library


def unchecked(lib: Library, safety: Safety | None) -> tuple[str, ...]:
    """Limits that are not checked: not stated by the robot, or not requested.

    Args:
        lib: the robot.
        safety: limits that are kept; None is the document's mode.

    Returns:
        Kind of each limit, with the joints where it concerns some only.
    """
    if safety is None:
        return ("torque", "self-collision", "table")
    limits = lib.limits()
    names = np.array(lib.joint_names)
    missing = []
    for key, what in (("effort", "torque"), ("torque_rate", "torque rate")):
        free = ~np.isfinite(limits[key])
        if free.any():
            missing.append(f"{what} of {', '.join(names[free])}")
    if lib.braking is None:
        missing.append("position-dependent velocity")
    if not np.isfinite(limits["tip_speed"]):
        missing.append("tip speed")
    if not lib.pairs:
        missing.append("self-collision")
    if safety.table is None:
        missing.append("table")
    if safety.carried is not None and safety.carried.box is None:
        missing.append("distances of the carried body")
    return tuple(missing)
