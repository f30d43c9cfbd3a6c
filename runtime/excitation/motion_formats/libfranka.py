"""q, dq, ddq for every millisecond of libfranka's 1 kHz control cycle, as CSV."""

import re
from pathlib import Path

import numpy as np

from runtime.common.files import replacing
from runtime.excitation.motion_formats.format import MotionFormat, write_comments
from runtime.excitation.proof.certified_motion import CertifiedMotion

CONTROL_RATE = 1000
"""Rate of libfranka's control cycle, Hz."""


def _write(motion: CertifiedMotion, rate: float, path: Path) -> None:
    """Write one row per cycle, the command k ms after the start; the last is at rest at home.

    The duration is rounded up to whole milliseconds; the motion itself ends at t_f.
    """
    del rate  # the control cycle fixes it
    lib, duration = motion.lib, motion.trajectory.duration
    steps = int(np.ceil(duration * CONTROL_RATE * (1 - 1e-12)))
    t = np.arange(steps + 1) / CONTROL_RATE
    q, dq, ddq, _ = motion.trajectory.at(lib, np.minimum(t, duration))
    units = [joint.unit for joint in lib.manifest.joints]
    names = [re.sub(r'[^ -~]|[,"#]', "_", name) for name in lib.joint_names]  # of a URDF
    titles = ["t [s]"]
    for signal, per in (("q", ""), ("dq", "/s"), ("ddq", "/s^2")):
        titles += [
            f"{signal} {name} [{unit}{per}]" for name, unit in zip(names, units, strict=True)
        ]
    with replacing(path) as file:
        write_comments(
            file,
            (
                *motion.header(),
                f"{steps + 1} rows, one per ms of the 1 kHz loop, {steps} ms; start at rest in "
                "row 0, the robot must stand there",
                "joint order: " + ", ".join(names),
            ),
        )
        table = np.hstack([t[:, None], q, dq, ddq])
        head = ",".join(titles)
        np.savetxt(file, table, fmt="%.17g", delimiter=",", header=head, comments="")


LIBFRANKA = MotionFormat(
    "libfranka", ".libfranka.csv", "q, dq, ddq in one row per millisecond", _write
)
