"""Model of the guards before an arm is identified: the bodies of the URDF, and its error."""

import numpy as np

from runtime.errors import IdentificationError
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation

MODEL_ERROR = (0.006, 0.03, 0.5)
"""σ of the modelled torque of an arm that is not identified: 0.6 % of the effort limit, at least
0.5 N·m, at most 3 %; friction of wrists is that large."""


def model_error(lib: Library) -> Array:
    """σ of the modelled torque of an arm that is not identified yet, (n,) [N·m, N]."""
    effort = lib.limits()["effort"]
    bounded = np.isfinite(effort) & (effort > 0)
    if not bounded.all():
        j = int(np.argmin(bounded))
        raise IdentificationError(
            f"expected an effort limit of {lib.joint_names[j]} for the guard of the external "
            "torque; state it in the URDF, or as effort under [[link]] of a TOML file"
        )
    low, high, least = MODEL_ERROR
    return np.asarray(np.minimum(high * effort, np.maximum(low * effort, least)))


def urdf_model(lib: Library) -> SavedResult:
    """The bodies of the URDF without friction, as a model of the observer."""
    n = lib.n_joints
    return SavedResult(
        robot=lib.name,
        method="urdf",
        joints=lib.joint_names,
        units=("N*m",) * n,
        pi=lib.pi0,
        friction=Friction(()),
        phi=np.zeros((n, 0)),
        net=None,
        history=(),
        preparation=Preparation(),
        model=None,
    )
