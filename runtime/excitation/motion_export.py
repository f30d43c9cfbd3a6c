"""A certified trajectory as files that a robot, a simulator or a spreadsheet takes.

| kind | file | holds |
|---|---|---|
| csv, npz | NAME.csv, NAME.npz | t, q, dq, ddq at any rate; `runtime.read_recording` reads them |
| ros | NAME.ros.yaml | one trajectory_msgs/JointTrajectory of ROS 2 at any rate |
| libfranka | NAME.libfranka.csv | q, dq, ddq for every millisecond of a 1 kHz control loop |

The certificate stands in the header of every file that has one, and beside all as JSON.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from runtime.errors import ExportError
from runtime.excitation import Safety, Trajectory
from runtime.excitation.motion.trajectory import sample_times
from runtime.excitation.proof.certificate import Certificate, Use, certificate, fastest
from runtime.files import replacing
from runtime.library import Array, Library
from runtime.recording import Recording, write_recording

CONTROL_RATE = 1000
"""Of libfranka's control loop, Hz."""


@dataclass(frozen=True, slots=True)
class _Motion:
    """What the writers write: a trajectory of a robot with its certificate."""

    lib: Library
    trajectory: Trajectory
    proof: Certificate
    rate: float

    def times(self) -> Array:
        return sample_times(self.trajectory.duration, self.rate)

    def header(self) -> tuple[str, ...]:
        first = (
            f"Excitation of '{self.lib.name}', {self.trajectory.duration:.17g} s. "
            "Limits at every instant, between samples too:"
        )
        return (first, *self.proof.sentences())


def export_trajectory(
    lib: Library,
    trajectory: Trajectory,
    base: Path,
    kind: str,
    rate: float = 1000.0,
    safety: Safety | None = None,
) -> Path:
    """Write one kind of file, and the certificate as `base`.certificate.json; atomically.

    Args:
        lib: the robot.
        trajectory: its motion.
        base: path without suffix.
        kind: one of `EXPORTS`.
        rate: of csv, npz and ros, Hz.
        safety: limits beyond those of position and its derivatives; None looks at none.

    Returns:
        The path of the file.

    Raises:
        ExportError: another kind, or a limit that is not proven to be kept; nothing is written.
    """
    if kind not in EXPORTS:
        raise ExportError(f"expected one of {', '.join(EXPORTS)} to export, got '{kind}'")
    proof = require_proof(lib, trajectory, safety)
    suffix, write = EXPORTS[kind]
    path = base.with_name(base.name + suffix)
    write(_Motion(lib, trajectory, proof, rate), path)
    _write_certificate(lib, trajectory, proof, base.with_name(base.name + ".certificate.json"))
    return path


def require_proof(
    lib: Library, trajectory: Trajectory, safety: Safety | None = None
) -> Certificate:
    """The certificate of what may be sent to a robot.

    Raises:
        ExportError: the limits that are exceeded, and what would help.
    """
    proof = certificate(lib, trajectory, safety)
    if proof.holds:
        return proof
    broken = ", ".join(
        f"{use.kind} of {use.where} at {100 * use.bound:.4g} % ({use.time:.3f} s)"
        for use in proof.broken
    )
    percent = 100 * fastest(lib, trajectory, safety)
    advice = (
        f"add --speed {percent:.0f}, at which they are kept"
        if percent >= 1
        else "design another motion"
    )
    raise ExportError(f"nothing is exported, the motion exceeds limits: {broken}; {advice}")


def _write_certificate(
    lib: Library, trajectory: Trajectory, proof: Certificate, path: Path
) -> None:
    facts = {
        "robot": lib.name,
        "duration": trajectory.duration,
        "holds": proof.holds,
        "uses": [_facts(use) for use in proof.uses],
        "distances": [_facts(use) for use in proof.distances],
        "no_limit_stated": list(proof.unlimited),
        "not_checked": list(proof.unchecked),
    }
    with replacing(path) as file:
        file.write((json.dumps(facts, indent=1) + "\n").encode())


def _facts(use: Use) -> dict[str, object]:
    how = "proven" if use.is_proven else "measured at 1 kHz with exact derivatives"
    return {
        "limit": use.kind,
        "bound": use.bound,
        "margin": use.margin,
        "where": use.where,
        "t": use.time,
        "value": use.value,
        "allowed": use.limit,
        "unit": use.unit,
        "how": how,
    }


def _write_recording(motion: _Motion, path: Path) -> None:
    t = motion.times()
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, t)
    names = motion.lib.joint_names
    history = motion.header()
    write_recording(
        Recording(t, q, dq, ddq, name=path.stem, joint_names=names, history=history), path
    )


def _write_ros(motion: _Motion, path: Path) -> None:
    """One message as `ros2 topic pub` and YAML loaders take it; the stamps are whole ns."""
    stamps = np.round(motion.times() * 1e9).astype(np.int64)
    if len(np.unique(stamps)) < len(stamps):
        raise ExportError(
            f"ROS stamps whole nanoseconds, too coarse for {motion.rate:g} Hz; lower the --rate"
        )
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, stamps.astype(np.float64) * 1e-9)
    with replacing(path) as file:
        _comment(file, motion.header())
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


def _write_libfranka(motion: _Motion, path: Path) -> None:
    """Row k is the command of the cycle k ms after the start; the last row is at rest at home.

    The duration is rounded up to whole milliseconds; the motion itself ends at t_f.
    """
    lib, duration = motion.lib, motion.trajectory.duration
    steps = int(np.ceil(duration * CONTROL_RATE * (1 - 1e-12)))
    t = np.arange(steps + 1) / CONTROL_RATE
    q, dq, ddq, _ = motion.trajectory.at(lib, np.minimum(t, duration))
    units = [joint.unit for joint in lib.manifest.joints]
    titles = ["t [s]"]
    for signal, per in (("q", ""), ("dq", "/s"), ("ddq", "/s^2")):
        titles += [
            f"{signal} {name} [{unit}{per}]"
            for name, unit in zip(lib.joint_names, units, strict=True)
        ]
    with replacing(path) as file:
        _comment(
            file,
            (
                *motion.header(),
                f"{steps + 1} rows, one per ms of the 1 kHz loop, {steps} ms; start at rest in "
                "row 0, the robot must stand there",
                "joint order: " + ", ".join(lib.joint_names),
            ),
        )
        table = np.hstack([t[:, None], q, dq, ddq])
        head = ",".join(titles)
        np.savetxt(file, table, fmt="%.17g", delimiter=",", header=head, comments="")


def _comment(file: IO[bytes], lines: tuple[str, ...]) -> None:
    file.write("".join(f"# {line}\n" for line in lines).encode())


EXPORTS: dict[str, tuple[str, Callable[[_Motion, Path], None]]] = {
    "csv": (".csv", _write_recording),
    "npz": (".npz", _write_recording),
    "ros": (".ros.yaml", _write_ros),
    "libfranka": (".libfranka.csv", _write_libfranka),
}
"""Suffix and writer of each kind."""
