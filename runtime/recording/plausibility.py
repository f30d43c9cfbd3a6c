"""Agreement of a recording with a robot: joint count, units and sign, which are never guessed."""

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Library
from runtime.library.torque_units import common_unit, torque_units
from runtime.recording import Recording
from runtime.recording.recipes.unread_signals import states_unread

OUTSIDE = 1.0
"""Distance beyond a joint limit from which on the unit, order or robot is wrong [rad, m]."""

SMALLEST = 1e-9
"""Largest torque below which nothing was measured, or the unit is wrong [N·m, N]."""

SLOWEST = 2.0
"""Rate below which differences of positions do not determine the velocity [Hz]."""


def require_plausible(recording: Recording, lib: Library) -> None:
    """Require that a recording agrees with the model of the robot."""
    require_joints(recording, lib)
    if recording.tau is None:
        unread = [step for step in recording.history if states_unread(step)]
        raise IdentificationError(
            f"the recording '{recording.name}' has no torque, which identification needs"
            + "".join(f"; {step.removeprefix('Warning: ').rstrip('.')}" for step in unread)
        )
    largest = float(np.abs(recording.tau).max())
    if largest < SMALLEST:
        much = (
            f"at most {largest:.2g} {common_unit(torque_units(lib.manifest))}"
            if largest
            else "0 throughout"
        )
        raise IdentificationError(
            f"the torque of the recording '{recording.name}' is {much}; log the measured one"
        )
    require_motion(recording, lib)
    _require_sign(recording, lib)


def require_motion(recording: Recording, lib: Library) -> None:
    """Require that the robot can make the motion."""
    require_joints(recording, lib)
    if recording.dq is None and len(recording) > 1 and recording.rate_hz < SLOWEST:
        raise IdentificationError(
            f"the recording '{recording.name}' has no dq, and its rate of {recording.rate_hz:.3g} "
            "Hz is too low to differentiate q; if its time is in ms, state that in a recipe"
        )
    limits = lib.limits()
    # A minimum over short rows takes ten times as long.
    joints = np.ascontiguousarray(recording.q.T)
    low, high = joints.min(axis=1), joints.max(axis=1)
    beyond = np.maximum(limits["lower"] - low, high - limits["upper"])
    worst = int(np.argmax(beyond))
    if beyond[worst] > OUTSIDE:
        raise IdentificationError(
            f"joint '{lib.joint_names[worst]}' moves from {low[worst]:.3g} to {high[worst]:.3g}, "
            f"its limits are {limits['lower'][worst]:.3g} to {limits['upper'][worst]:.3g} "
            f"{lib.manifest.joints[worst].unit}; state unit, order, sign and offset in a recipe, "
            "or choose another --robot"
        )


def require_joints(recording: Recording, lib: Library) -> None:
    """Require that a recording has the joints of the robot."""
    n = lib.n_joints
    if recording.q.shape[1] != n:
        raise IdentificationError(
            f"the recording '{recording.name}' has {recording.q.shape[1]} joints, the robot "
            f"'{lib.name}' has {n} ({', '.join(lib.joint_names)}); choose --robot, or build it "
            "with --base, --tip and --lock"
        )


def _require_sign(recording: Recording, lib: Library) -> None:
    """Refuse a measured torque that correlates with minus the gravity torque of the model."""
    tau = recording.required("tau")
    still = np.zeros_like(recording.q)
    gravity = lib.inverse_dynamics(recording.q, still, still, lib.pi0)
    size = np.linalg.norm(gravity) * np.linalg.norm(tau)
    if size == 0:
        return
    alike = float(np.sum(gravity * tau) / size)
    if alike < -0.5:
        raise IdentificationError(
            f"the measured torque runs against the model's gravity torque (correlation "
            f"{alike:.2f}): either the log counts torque with the opposite sign (set sign = -1 "
            "for [torque] in a recipe), or gravity points the other way (build with --gravity)"
        )
