"""Agreement of a log with the robot: units of joints, sign of wrenches, errors that stay."""

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.prior_file import PriorFile
from runtime.identification.free_base.rows import FreeBaseRows
from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.recording.consistency import (
    BEYOND_LIMIT,
    DEGREE,
    LEAST_RATE,
    STRIDE,
    UNITS_OF_TIME,
    slopes_of,
)
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion
from runtime.recording.recording import Recording

_OPPOSITE = 3.0
"""Residual of the URDF over that with the opposite sign from which signs count as wrong."""
_FASTEST = 300.0
"""RMS acceleration of the base, m/s², from which its unit or its noise is wrong: 30 times g."""
_SLOPE = 0.15
"""Relative distance of a ratio of units that names it."""
_UNEXPLAINED = 0.5
"""Error over RMS of half of the rows from which a note states it."""
_FAR = 3.0
"""Distance of a sensor's error from 0 in its standard deviations from which a note states it."""


def require_prior_of_bodies(prior: PriorFile | None) -> None:
    """Refuse entries of a prior that describe friction, rotors or noise of joints."""
    if prior is None:
        return
    tables = {"armature": prior.armature, "friction": prior.friction, "noise": prior.noise}
    stated = [f"[{key}]" for key, value in tables.items() if value is not None]
    if stated:
        raise IdentificationError(
            f"the prior states {', '.join(stated)}, and the equations of a free base have bodies "
            "only; remove this table from the prior"
        )


def require_clock(recording: FreeBaseRecording) -> None:
    """Refuse a time that is not in seconds.

    Compared are joint velocities, else the velocity of the base, with the positions; a log
    without them is refused where its rate is too low to differentiate.
    """
    t, name = recording.t, recording.name
    if recording.dq is not None:
        measured = Recording(t, recording.q, dq=recording.dq)
    elif recording.twist is not None:
        velocity = np.einsum("nij,nj->ni", recording.rotation, recording.twist[:, :3])
        measured = Recording(t, recording.position, dq=velocity)
    else:
        rate = 1.0 / float(np.median(np.diff(t)))
        if rate < LEAST_RATE:
            raise IdentificationError(
                f"{name} has no velocities, and its rate of {rate:.3g} Hz is too low to "
                "differentiate the positions; give t in s"
            )
        return
    if len(t) <= 2 * STRIDE:
        return
    slopes = slopes_of(measured)
    for unit, factor in UNITS_OF_TIME.items():
        wrong = np.flatnonzero(np.abs(slopes / factor - 1.0) < _SLOPE)
        if wrong.size:
            raise IdentificationError(
                f"{name}: time looks like {unit}, positions change by {slopes[wrong[0]]:.3g} times "
                "the integral of the velocities; give t in s"
            )


def require_joint_units(lib: Library, motion: FreeBaseMotion, name: str) -> None:
    """Refuse joint positions far outside the limits, velocities in degrees, positions in mm."""
    fastest = float(np.sqrt(np.mean(np.sum(np.square(motion.ddq[:, :3]), axis=1))))
    if fastest > _FASTEST:
        raise IdentificationError(
            f"{name}: the base accelerates by {fastest:.3g} m/s² (RMS), expected at most "
            f"{_FASTEST:g}; give positions in m and t in s, or a low-pass with --cutoff"
        )
    q, dq = motion.q[:, FREEDOM:], motion.dq[:, FREEDOM:]
    limits = lib.limits()
    low, high = q.min(axis=0), q.max(axis=0)
    beyond = np.maximum(limits["lower"] - low, high - limits["upper"])
    worst = int(np.argmax(beyond))
    if beyond[worst] > BEYOND_LIMIT:
        joint = lib.manifest.joints[worst]
        raise IdentificationError(
            f"{name}: joint '{joint.name}' moves from {low[worst]:.3g} to {high[worst]:.3g}, its "
            f"limits are {limits['lower'][worst]:.3g} to {limits['upper'][worst]:.3g} "
            f"{joint.unit}; give q in this unit, and the names of its columns by joints"
        )
    slopes = slopes_of(Recording(motion.t, q, dq=dq))
    for factor, unit in ((1 / DEGREE, "degrees per second"), (DEGREE, "radians for q in degrees")):
        wrong = np.flatnonzero(np.abs(slopes / factor - 1.0) < _SLOPE)
        if wrong.size:
            raise IdentificationError(
                f"{name}: the velocity of joint '{lib.joint_names[wrong[0]]}' looks like {unit}, "
                "expected the derivative of q; convert q to rad and dq to rad/s"
            )


def require_forces_on_robot(lib: Library, rows: FreeBaseRows, name: str) -> None:
    """Refuse contact wrenches of the opposite sign, such as forces on the ground.

    Compared are the equations of the base, whose right side is that of the wrenches alone.
    """
    alone = not any(row in rows.names for row in lib.joint_names)
    complete = rows.samples.equations == len(rows.names) >= FREEDOM
    if not (alone or complete):
        return
    kept = slice(None) if alone else slice(FREEDOM)
    predicted = rows.samples.rigid(lib, lib.pi0)[:, kept]
    measured = rows.samples.tau[:, kept]
    if float(np.linalg.norm(predicted - measured)) > _OPPOSITE * float(
        np.linalg.norm(predicted + measured)
    ):
        raise IdentificationError(
            f"{name}: the contact wrenches are opposite to those that hold the URDF, expected "
            "forces on the robot; change their sign, or give quaternions of base_pose as x y z w"
        )


def notes_on_errors(
    rms: Array,
    after: Array,
    sensors: dict[str, float],
    sigma: Array | None,
    joints_are_named: bool = True,
) -> tuple[str, ...]:
    """Notes on rows that the result does not explain, and on sensors far from what was stated."""
    notes = []
    loaded = rms > 0
    if not loaded.any():
        notes.append(
            "torques and wrenches of the test part are zero throughout, as in free flight; if "
            "sensors were off, choose another --split"
        )
    share = float(np.median(after[loaded] / rms[loaded])) if loaded.any() else 0.0
    if share > _UNEXPLAINED:
        unnamed = "" if joints_are_named else " (the log has no array joints, which names them)"
        notes.append(
            f"half of the rows keep an error of {100 * share:.0f} % of their RMS or more: torques "
            "and wrenches do not fit this robot and motion; check names and order of joints"
            f"{unnamed} and contacts, contact_position, contact_kind, contact_axes and units"
        )
    for (name, value), spread in zip(sensors.items(), () if sigma is None else sigma, strict=True):
        if abs(value) > _FAR * spread:
            notes.append(
                f"sensors: the error of {name} is {abs(value) / spread:.1f} times its stated "
                "standard deviation; check the contact forces, or state a larger one"
            )
    return tuple(notes)
