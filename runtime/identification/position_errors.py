"""Errors of positions that a model predicts from the commands of a control law alone.

What a model of a servo arm is for: where the joints go for a sequence of commands. The prediction
starts at the first row and sees no measurement after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.common.tables import NOTHING, Table, number, percent
from runtime.errors import SimulationError
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.recording.commanded_torque import per_joint
from runtime.recording.settings import COLUMNS
from runtime.simulation.commanded_motion import ServoDrive, commanded_motion

FIRST = 5
"""Rows whose slope is the first velocity, where none was measured."""
MOST_SECONDS = 300.0
"""Length of the part that is predicted [s]."""


@dataclass(frozen=True, slots=True)
class PositionErrors:
    """RMS over the rows per joint, (n,) [rad, m]."""

    commanded: tuple[float, ...]  # of the command less the measured position
    predicted: tuple[float, ...]  # of the predicted less the measured position
    seconds: float  # length of the part


def drive_term(saved: SavedResult, model_term: str) -> Array:
    """Coefficients (n,) of the columns that stand for a term of simulators' joints."""
    named = [COLUMNS[name].model_term == model_term for name in saved.friction.columns]
    return np.maximum(saved.phi[:, named].sum(axis=1), 0.0)


def position_errors(
    saved: SavedResult, lib: Library, recording: Recording, prepared: Recording
) -> tuple[PositionErrors | None, tuple[str, ...]]:
    """Errors of a log as read, by the delay of the log as prepared; and sentences on them."""
    law, tau = recording.law, recording.tau
    if law is None or tau is None or any(value is None for value in law.numbers.values()):
        return None, ()
    n = lib.n_joints
    kp, kd, limit, gear = (per_joint("torque", key, value, n) for key, value in law.numbers.items())
    stiffness, damping = gear**2 * kp, gear**2 * kd
    if not stiffness.all():
        return None, ("positions are not predicted: a joint whose kp is 0 follows no command",)
    if np.any(np.abs(tau) >= np.where(limit > 0, gear * limit, np.inf)):
        return None, ("positions are not predicted: rows at the effort limit hide the commands",)
    # As far as it is needed: with kd the log has dq.
    command = tau + stiffness * recording.q
    if damping.any():
        command = command + damping * recording.required("dq")
    t, rows = recording.t, recording.t <= recording.t[0] + MOST_SECONDS
    late = _delay(saved, prepared, n)
    moved = np.stack([np.interp(t - d, t, c) for d, c in zip(late, command.T, strict=True)], axis=1)
    columns = saved.friction.columns
    constant = [COLUMNS[name].is_constant for name in columns]
    # The law acts late as a whole, −K q(t − d) − D dq(t − d): to second order in d a torque of
    # −K q − (D − K d) dq − (K d²/2 − D d) ddq.
    viscous = drive_term(saved, "damping")
    inertia = drive_term(saved, "armature") + stiffness * late**2 / 2 - damping * late
    drive = ServoDrive(
        stiffness,
        damping=np.maximum(damping - stiffness * late, -viscous),
        viscous=viscous,
        dry=drive_term(saved, "friction"),
        offset=saved.phi[:, constant].sum(axis=1),
        armature=np.maximum(inertia, 0.0),
    )
    parts = saved.record.drive
    zero = np.array([part.encoder_bias or 0.0 for part in parts]) if parts else np.zeros(n)
    slope = np.polyfit(t[:FIRST] - t[0], recording.q[:FIRST], 1)[0]
    first = recording.q[0], slope if recording.dq is None else recording.dq[0]
    try:
        q = commanded_motion(lib, saved.pi, drive, t[rows], moved[rows], first, zero)
    except SimulationError as fault:
        return None, (f"positions are not predicted: {fault}",)
    errors = PositionErrors(
        commanded=_rms(command[rows] / stiffness - recording.q[rows]),
        predicted=_rms(q - recording.q[rows]),
        seconds=float(np.ptp(t[rows])),
    )
    left = [name for name in columns if not (COLUMNS[name].model_term or COLUMNS[name].is_constant)]
    note = f"positions are predicted without the friction columns {', '.join(left)}"
    return errors, (note,) if left else ()


def _rms(error: Array) -> tuple[float, ...]:
    return tuple(np.sqrt(np.mean(error**2, axis=0)).tolist())


def position_table(joints: Sequence[str], errors: PositionErrors) -> Table:
    """Errors per joint, and the share that the model leaves of those of the commands."""
    rows = zip(joints, errors.commanded, errors.predicted, strict=True)
    return Table(
        ("joint", "RMS of command − q", "RMS of prediction − q", "share"),
        tuple(
            (name, number(a), number(b), percent(100 * b / a) if a else NOTHING)
            for name, a, b in rows
        ),
        title=f"positions predicted from the commands alone, {errors.seconds:.0f} s [rad or m]",
    )


def _delay(saved: SavedResult, prepared: Recording, n: int) -> Array:
    """Time from a command to its torque (n,) [s]: of the preparation, else of the logs."""
    steps, sessions = prepared.prepared, saved.record.sessions
    if steps is not None and steps.torque_delay_s is not None:
        return -per_joint("preparation", "torque_delay_s", steps.torque_delay_s, n)
    logs = () if sessions is None or sessions.delay_s is None else sessions.delay_s
    known = [np.broadcast_to(each.value, n) for each in logs if each.value is not None]
    return np.median(known, axis=0) if known else np.zeros(n)
