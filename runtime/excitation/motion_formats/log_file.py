"""Motions as log files: t, q, dq, ddq at any rate, read back by `runtime.read_recording`."""

from pathlib import Path

from runtime.excitation.motion.trajectory import sample_times
from runtime.excitation.motion_formats.format import MotionFormat
from runtime.excitation.proof.certified_motion import CertifiedMotion
from runtime.recording import Recording, write_recording


def _write(motion: CertifiedMotion, rate: float, path: Path) -> None:
    t = sample_times(motion.trajectory.duration, rate)
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, t)
    names, history = motion.lib.joint_names, motion.header()
    write_recording(
        Recording(t, q, dq, ddq, name=path.stem, joint_names=names, history=history), path
    )


CSV = MotionFormat("csv", ".csv", "t, q, dq, ddq at the rate, as text", _write)
NPZ = MotionFormat("npz", ".npz", "the same as a NumPy archive", _write)
