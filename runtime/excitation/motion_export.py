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
from collections.abc import Collection
from pathlib import Path

from runtime.common.files import replacing
from runtime.errors import ExportError
from runtime.excitation.limits.unchecked import require_consent
from runtime.excitation.motion_formats.format import MotionFormat
from runtime.excitation.proof.certificate import Use
from runtime.excitation.proof.certified_motion import CertifiedMotion
from runtime.registry import Registry

_FORMATS = "runtime.excitation.motion_formats"
MOTION_FORMATS = Registry(
    "symgen.motion_formats",
    MotionFormat,
    "format of motions",
    {
        "csv": f"{_FORMATS}.log_file:CSV",
        "npz": f"{_FORMATS}.log_file:NPZ",
        "ros": f"{_FORMATS}.ros:ROS",
        "libfranka": f"{_FORMATS}.libfranka:LIBFRANKA",
    },
)
"""File formats of a motion by name."""
CERTIFICATE = ".certificate.json"
"""End of the file name of the certificate."""


def export_trajectory(
    motion: CertifiedMotion,
    base: Path,
    kind: str,
    rate: float | None = None,
    unchecked: Collection[str] = (),
) -> Path:
    """Write one kind of file, and the certificate as `base`.certificate.json; atomically."""
    if kind not in MOTION_FORMATS:
        raise ExportError(f"expected one of {', '.join(MOTION_FORMATS)} to export, got '{kind}'")
    motion.require_limits()
    require_consent(motion.certificate.unchecked, unchecked)
    chosen = MOTION_FORMATS[kind]
    path = base.with_name(base.name + chosen.suffix)
    chosen.write(motion, chosen.rate if rate is None else rate, path)
    _write_certificate(motion, base.with_name(base.name + CERTIFICATE))
    return path


def _write_certificate(motion: CertifiedMotion, path: Path) -> None:
    certificate = motion.certificate
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
        "intervals": use.intervals,
    }
