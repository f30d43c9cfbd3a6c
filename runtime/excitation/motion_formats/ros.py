"""One trajectory_msgs/JointTrajectory of ROS 2 as YAML, at any rate."""

import json
from pathlib import Path

import numpy as np

from runtime.common.files import replacing
from runtime.errors import ExportError
from runtime.excitation.motion.trajectory import sample_times
from runtime.excitation.motion_formats.format import MotionFormat, write_comments
from runtime.excitation.proof.certified_motion import CertifiedMotion
from runtime.library import Array

RATE = 25.0
"""Default rate, Hz.

Controllers join points by quintic polynomials through position, velocity and acceleration. Their
error h⁶/46080 max|q⁽⁶⁾| is below 1e-6 rad for h = 40 ms. A YAML parser takes 2 s for 1000 points.
"""


def _write(motion: CertifiedMotion, rate: float, path: Path) -> None:
    """Write one message for `ros2 topic pub` and YAML loaders; the stamps are whole ns."""
    stamps = np.round(sample_times(motion.trajectory.duration, rate) * 1e9).astype(np.int64)
    if len(np.unique(stamps)) < len(stamps):
        raise ExportError(
            f"ROS stamps whole nanoseconds, too coarse for {rate:g} Hz; lower the --export-rate"
        )
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, stamps.astype(np.float64) * 1e-9)
    with replacing(path) as file:
        write_comments(file, motion.header())
        text = "header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''\njoint_names:\n"
        text += "".join(f"- {json.dumps(name)}\n" for name in motion.lib.joint_names)
        file.write((text + "points:\n").encode())
        for stamp, *rows in zip(stamps.tolist(), q, dq, ddq, strict=True):
            sec, nanosec = divmod(stamp, 1_000_000_000)
            position, velocity, acceleration = (_flow(row) for row in rows)
            file.write(
                f"- positions: {position}\n  velocities: {velocity}\n"
                f"  accelerations: {acceleration}\n  effort: []\n"
                f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}\n".encode()
            )


def _flow(row: Array) -> str:
    # 1.0e-05 and not 1e-05, which YAML 1.1 reads as text.
    return "[" + ", ".join(f"{x:.16e}" for x in row) + "]"


ROS = MotionFormat(
    "ros", ".ros.yaml", "a JointTrajectory message of ROS 2, by default at 25 Hz", _write, RATE
)
