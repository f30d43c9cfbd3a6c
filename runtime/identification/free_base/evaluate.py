"""Errors of the rows of a free base on a second log, by the URDF and by an identified model."""

from dataclasses import dataclass

import numpy as np

from runtime.identification.free_base.contact_states import with_contact_states
from runtime.identification.free_base.noise import rms
from runtime.identification.free_base.rows import Drives, error_names, rows_of
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import motion_of


@dataclass(frozen=True, slots=True, eq=False)
class RowErrors:
    """RMS of the right side of k rows, and of their errors, (k,) each.

    Attributes:
        names: of the rows.
        size: RMS of the measured forces and torques.
        before: RMS errors of the URDF.
        after: RMS errors of the result, its friction, delay and errors of sensors included.
    """

    names: tuple[str, ...]
    size: Array
    before: Array
    after: Array


def free_base_errors(
    recording: FreeBaseRecording, lib: Library, saved: SavedResult, cutoff_hz: float | None
) -> RowErrors:
    """Errors of a result on another log of the robot, low-passed at the cut-off [Hz]."""
    record, drives, late = saved.record, None, 0.0
    if recording.is_commanded:
        recording, _ = with_contact_states(recording, lib)
        delays = () if record is None else record.delays
        late = next((each.value for each in delays if isinstance(each.value, float)), 0.0)
        drives = Drives(saved.friction, delay_s=late)
    terms = None if drives is None else saved.friction
    motion = motion_of(recording, lib.joint_names, cutoff_hz, late, terms)
    # At the ends the low-pass and the shift by the delay lack samples.
    ends = max(late, 0.0 if cutoff_hz is None or drives is None else 1.0 / cutoff_hz)
    inside = (motion.t >= motion.t[0] + ends) & (motion.t <= motion.t[-1] - ends)
    motion = motion.rows(np.flatnonzero(inside))
    choice = "all" if record is None or not record.rows else record.rows
    rows = rows_of(lib, motion, choice, drives)
    known = (None if record is None else record.sensors) or {}
    sensors = [known[n].value if n in known else 0.0 for n in error_names(motion.contacts)]
    phi = np.concatenate([np.array(sensors, dtype=float), saved.phi.ravel() if drives else []])
    measured = rows.samples.tau
    after = rows.samples.rigid(lib, saved.pi) + rows.samples.columns @ phi
    names, shown = rows.shown(drives is not None)
    return RowErrors(
        names,
        rms(shown(measured)),
        rms(shown(rows.samples.rigid(lib, lib.pi0) - measured)),
        rms(shown(after - measured)),
    )
