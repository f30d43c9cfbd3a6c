"""A written file is right where its reader gives the torques of the library at 1000 random states.

max |τ_engine(file) − damping dq − armature ddq − Y π| / max |Y π|  ≤  1e-9
"""

from types import ModuleType

import numpy as np

from runtime.errors import ExportError
from runtime.library import Array
from runtime.outputs.model_files.engines.answer import STATES, Reloaded, random_states
from runtime.outputs.model_files.model import IdentifiedModel

TOLERANCE = 1e-9  # torque difference over the largest torque; 17 digits leave about 1e-14
REMEDY = "run: python -m symgen build"  # a robot that was changed after its build is built again


def compare_reloaded(engine: ModuleType, model: IdentifiedModel, text: str) -> str:
    """Compare what an engine reads with π, damping, dry friction and rotor inertia of the model."""
    reloaded: Reloaded | None = engine.reload(text, model.lib, model.states)
    if reloaded is None:
        return unchecked(engine.INSTALL)
    lib = model.lib
    expected = lib.inverse_dynamics(*random_states(lib, len(reloaded.tau)), model.pi)
    what = f"reloaded by {reloaded.engine}, the file gives torques that differ"
    difference = require_torques(reloaded.tau, expected, what, REMEDY)
    for quantity in ("damping", "friction", "armature"):
        read = getattr(reloaded, quantity)
        for k, value in enumerate(getattr(model.friction, quantity) if read is not None else ()):
            if value is not None and abs(read[k] - value) > TOLERANCE * value:
                name = lib.joint_names[k]
                what = f"the {quantity} of joint '{name}' is {read[k]:g}, expected {value:g}"
                raise reloaded_fault(reloaded.engine, what)
    return verified(reloaded.engine, difference, len(reloaded.tau))


def torque_difference(tau: Array, expected: Array) -> float:
    """Largest difference of two torque arrays (N, n) over the largest expected torque."""
    return float(np.abs(tau - expected).max() / np.abs(expected).max())


def require_torques(tau: Array, expected: Array, what: str, remedy: str) -> float:
    """Difference of two torque arrays that is rounding; else what differs, and the remedy."""
    difference = torque_difference(tau, expected)
    if not difference <= TOLERANCE:
        raise ExportError(
            f"not written: {what} by {difference:.1e} of the largest torque, where {TOLERANCE:g} "
            f"is allowed; {remedy}"
        )
    return difference


def verified(engine: str, difference: float, states: int = STATES) -> str:
    """Sentence on a file that passed the check."""
    return (
        f"verified: reloaded by {engine}, torques agree to {difference:.1e} of the largest torque "
        f"at {states} random states"
    )


def reloaded_fault(engine: str, what: str) -> ExportError:
    """Error of a file that reads back as another robot."""
    return ExportError(
        f"not written: reloaded by {engine}, {what}; report this as a fault of symgen"
    )


def unchecked(install: str) -> str:
    """Sentence on a file whose reader is not installed."""
    return f"not checked by reloading; to check it, {install}"
