"""Friction columns of joints that follow others: τ = Gᵀ c(G dq) φ, one coefficient per joint.

G = ∂x/∂q is the row of the joint in ∂q_all/∂q, which depends on the posture where a loop is closed.
With couplings it is constant, and the columns motor_… have the rows of several masters as well.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from runtime.errors import RecordingError
from runtime.recording.friction_column import (
    JOINT_COULOMB,
    JOINT_VISCOUS,
    FrictionColumn,
    JointMotion,
)
from runtime.recording.settings import Friction


def dependent_joint_column(name: str) -> FrictionColumn:
    """The record of `joint_viscous:NAME` or `joint_coulomb:NAME`."""
    prefix = JOINT_COULOMB if name.startswith(JOINT_COULOMB) else JOINT_VISCOUS
    joint = name.removeprefix(prefix)
    is_dry = prefix == JOINT_COULOMB
    return FrictionColumn(
        name,
        f"Gᵀ tanh(G dq / ε) of the joint {joint}" if is_dry else f"Gᵀ G dq of the joint {joint}",
        partial(_torque, name, joint, is_dry),
        widths=("coulomb_speed",) if is_dry else (),
        is_nonnegative=True,
        is_shared=True,
    )


def _torque(
    name: str, joint: str, is_dry: bool, motion: JointMotion, terms: Friction
) -> NDArray[np.float64]:
    lib = motion.lib
    if motion.q is None or lib is None:
        raise RecordingError(f"the column '{name}' needs q and the library of the robot; give lib")
    dependent = [each for each in lib.all_joint_names if each not in lib.joint_names]
    if joint not in dependent:
        listed = ", ".join(dependent) or "none"
        raise RecordingError(
            f"'{lib.name}' has no joint '{joint}' that follows others (there are: {listed}); name "
            "one of them; the columns viscous and coulomb are those of the independent joints"
        )
    row = lib.joint_jacobian(motion.q)[..., lib.all_joint_names.index(joint), :]
    speed = np.einsum("...n,...n->...", row, motion.dq)
    if is_dry:
        widths = np.broadcast_to(np.asarray(terms.coulomb_speed, dtype=float), row.shape[-1:])
        speed = np.tanh(speed / widths.min())
    return np.ascontiguousarray(row * speed[..., None])
