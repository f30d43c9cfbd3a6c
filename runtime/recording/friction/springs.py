"""Columns of springs of unknown stiffness: τ = S(q) k, one coefficient per spring."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.library import Library
from runtime.recording.friction_column import SPRING, FrictionColumn, JointMotion
from runtime.recording.settings import Friction


def spring_column(name: str) -> FrictionColumn:
    """The record of `spring:NAME`; the library decides whether the robot has that spring."""
    spring = name.removeprefix(SPRING)
    return FrictionColumn(
        name,
        f"(x − rest) ∂x/∂q of the spring {spring}",
        partial(_torque, spring),
        is_passive=False,
        is_shared=True,
    )


def spring_names(lib: Library) -> tuple[str, ...]:
    """Names of the columns of all springs of unknown stiffness of a robot, `spring:NAME`."""
    return tuple(f"{SPRING}{name}" for name in lib.manifest.springs)


def _torque(spring: str, motion: JointMotion, _: Friction) -> NDArray[np.float64]:
    if motion.q is None or motion.lib is None:
        raise RecordingError(
            f"the column 'spring:{spring}' needs q and the library of the robot; give lib"
        )
    names = motion.lib.manifest.springs
    if spring not in names:
        listed = ", ".join(f"spring:{name}" for name in names) or "none"
        raise RecordingError(
            f"'{motion.lib.name}' has no spring '{spring}' of unknown stiffness (there are: "
            f"{listed}); name one of them, or build the robot with [[spring]] in --mechanism"
        )
    return np.ascontiguousarray(motion.lib.spring_columns(motion.q)[..., names.index(spring)])
