"""A certified motion as files for a robot, a simulator or a spreadsheet.

| format | file | holds |
|---|---|---|
| csv, npz | NAME.csv, NAME.npz | t, q, dq, ddq at any rate; `runtime.read_recording` reads them |
| ros | NAME.ros.yaml | one trajectory_msgs/JointTrajectory of ROS 2 at any rate |
| libfranka | NAME.libfranka.csv | q, dq, ddq for every millisecond of a 1 kHz control cycle |

The certificate stands in the header of every file that has one, and beside all as JSON. Another
package adds a format by an entry point of the group "symgen.motion_formats".
"""

import json
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from runtime.common.files import replacing, write_json
from runtime.errors import ExportError
from runtime.excitation.limits.safety import require_consent
from runtime.excitation.motion.trajectory import sample_times
from runtime.excitation.proof.certificate import CertifiedMotion, Use
from runtime.library import Array
from runtime.recording import Recording, write_recording
from runtime.registry import Registry

ROS_RATE = 25.0
"""Default rate of ROS, Hz.

Controllers join points by quintic polynomials through position, velocity and acceleration. Their
error h⁶/46080 max|q⁽⁶⁾| is below 1e-6 rad for h = 40 ms. A YAML parser takes 2 s for 1000 points.
"""
CONTROL_RATE = 1000  # rate of libfranka's control cycle, Hz
CERTIFICATE = ".certificate.json"  # end of the file name of the certificate


@dataclass(frozen=True, slots=True)
class MotionFormat:
    """A file format in which a motion is written."""

    name: str  # word by which a user selects it
    suffix: str  # end of the file name, with its dot
    sentence: str  # what the file holds, for help texts
    write: Callable[[CertifiedMotion, float, Path], None]  # motion, rate [Hz], path; atomic
    rate: float = 1000.0  # sampling rate where the user states none, Hz


def export_trajectory(
    motion: CertifiedMotion,
    base: Path,
    kind: str,
    rate: float | None = None,
    unchecked: Collection[str] = (),
) -> Path:
    """Write one kind of file, and the certificate as `base`.certificate.json; atomically."""
    chosen = MOTION_FORMATS[kind]
    motion.require_limits()
    certificate = motion.certificate
    require_consent(certificate.unchecked, unchecked)
    path = base.with_name(base.name + chosen.suffix)
    chosen.write(motion, chosen.rate if rate is None else rate, path)
    facts = {
        "robot": motion.lib.name,
        "duration": motion.trajectory.duration,
        "holds": certificate.holds,
        "load": certificate.load,
        "uses": [_facts(use) for use in certificate.uses],
        "distances": [_facts(use) for use in certificate.distances],
        "no_limit_stated": list(certificate.unlimited),
        "not_checked": list(certificate.unchecked),
    }
    write_json(base.with_name(base.name + CERTIFICATE), facts)
    return path


def _facts(use: Use) -> dict[str, object]:
    return {
        "limit": use.kind,
        "bound": use.bound,
        "margin": use.margin,
        "where": use.where,
        "t": use.time,
        "value": use.value,
        "allowed": use.limit,
        "unit": use.unit,
        "how": "proven" if use.is_proven else "measured at 1 kHz with exact derivatives",
        "intervals": use.intervals,
    }


def _write_comments(file: IO[bytes], lines: tuple[str, ...]) -> None:
    """Write lines that begin with #."""
    file.write("".join(f"# {line}\n" for line in lines).encode())


def _write_ros(motion: CertifiedMotion, rate: float, path: Path) -> None:
    """Write one message for `ros2 topic pub` and YAML loaders; the stamps are whole ns."""
    stamps = np.round(sample_times(motion.trajectory.duration, rate) * 1e9).astype(np.int64)
    if len(np.unique(stamps)) < len(stamps):
        raise ExportError(
            f"ROS stamps whole nanoseconds, too coarse for {rate:g} Hz; lower the setting "
            f"export_rate"
        )
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, stamps.astype(np.float64) * 1e-9)
    with replacing(path) as file:
        _write_comments(file, motion.header())
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


def _write_log(motion: CertifiedMotion, rate: float, path: Path) -> None:
    t = sample_times(motion.trajectory.duration, rate)
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, t)
    names, history = motion.lib.joint_names, motion.header()
    log = Recording(t, q, dq, ddq, name=path.stem, joint_names=names, history=history)
    write_recording(log, path)


def _write_libfranka(motion: CertifiedMotion, rate: float, path: Path) -> None:
    """Write one row per cycle, k ms after the start; the last one, at a whole ms, is at rest."""
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
        _write_comments(
            file,
            (
                *motion.header(),
                f"{steps + 1} rows, one per ms of the 1 kHz loop, {steps} ms; start at rest in "
                "row 0, the robot must stand there",
                "joint order: " + ", ".join(names),
            ),
        )
        table = np.hstack([t[:, None], q, dq, ddq])
        np.savetxt(file, table, fmt="%.17g", delimiter=",", header=",".join(titles), comments="")


CSV = MotionFormat("csv", ".csv", "t, q, dq, ddq at the rate, as text", _write_log)
NPZ = MotionFormat("npz", ".npz", "the same as a NumPy archive", _write_log)
ROS = MotionFormat(
    "ros",
    ".ros.yaml",
    "a JointTrajectory message of ROS 2, by default at 25 Hz",
    _write_ros,
    ROS_RATE,
)
LIBFRANKA = MotionFormat(
    "libfranka", ".libfranka.csv", "q, dq, ddq in one row per millisecond", _write_libfranka
)
MOTION_FORMATS = Registry(  # file formats of a motion by name
    "symgen.motion_formats",
    MotionFormat,
    "format of motions",
    {name.lower(): f"{__name__}:{name}" for name in ("CSV", "NPZ", "ROS", "LIBFRANKA")},
    ExportError,
)
