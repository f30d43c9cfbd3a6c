"""Files that `symgen excite` writes: the sampled motion and its exports at several speeds."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from runtime.cli.certificate_table import certificate_headline, certificate_table
from runtime.cli.common import console, say
from runtime.errors import RuntimeFault
from runtime.excitation import LONGEST, Design
from runtime.excitation.motion_export import CERTIFICATE, MOTION_FORMATS, export_trajectory
from runtime.excitation.proof.certified_motion import (
    CertifiedMotion,
    certified,
    require_speed,
    slowed,
)
from runtime.recording import Recording, write_recording
from runtime.simulation import sample_times

ROWS_HZ = 1000.0
"""Default rate of the sampled motion."""


def stage_speeds(duration: float, percents: Sequence[float]) -> list[float]:
    """Speeds of the stages over that of the designed motion."""
    shares = [require_speed(percent / 100) for percent in percents]
    slowest = duration / min(shares)
    if slowest > LONGEST:
        raise RuntimeFault(
            f"expected stages up to {LONGEST:g} s, but --speed {100 * min(shares):g} makes the "
            f"motion of {duration:g} s {slowest:.3g} s long; give a larger --speed"
        )
    return shares


def files_of(
    path: Path, formats: Collection[str], speeds: Sequence[float], pictures: bool
) -> tuple[Path, ...]:
    """Files that `excite` writes."""
    files = [path]
    if pictures:
        from runtime.outputs.report.motion_figures import picture_paths  # matplotlib loads slowly

        files += picture_paths(path.with_suffix(".png"))
    if not formats:
        files.append(path.with_suffix(".csv"))
    suffixes = [*(MOTION_FORMATS[name].suffix for name in formats), CERTIFICATE]
    for stem in [_stem(path.with_suffix(""), percent) for percent in speeds] if formats else []:
        files += [stem.with_name(stem.name + suffix) for suffix in suffixes]
    return tuple(files)


def write_motion_log(motion: CertifiedMotion, rate: float, path: Path, sentence: str) -> Path:
    """Write a motion, sampled at the rate, as a log without torque."""
    t = sample_times(motion.trajectory.duration, rate)
    q, dq, ddq, _ = motion.trajectory.at(motion.lib, t)
    names = motion.lib.joint_names
    write_recording(
        Recording(t, q, dq, ddq, name=path.stem, joint_names=names, history=(sentence,)), path
    )
    return path


def designed_by(optimum: Design) -> str:
    """History of the log of a designed motion."""
    return f"Designed by symgen, condition number {optimum.condition:.4f}."


def at_speed(motion: CertifiedMotion, speed: float) -> CertifiedMotion:
    """The same path at a fraction of the speed, with the certificate of that speed."""
    if speed == 1:
        return motion
    return certified(motion.lib, slowed(motion.trajectory, speed), motion.safety)


def certified_stages(
    motion: CertifiedMotion, speeds: Sequence[float]
) -> dict[float, CertifiedMotion]:
    """Print the certificate of every stage."""
    stages = {100 * share: at_speed(motion, share) for share in speeds}
    for percent, stage in stages.items():
        for line in certificate_headline(stage.certificate, percent):
            say(line)
        console.print(certificate_table(stage.certificate))
    return stages


def export_stages(
    stages: Mapping[float, CertifiedMotion],
    base: Path,
    kinds: Sequence[str],
    rate: float | None,
    unchecked: Collection[str],
) -> None:
    """Write every stage as files for a robot, or none unless the certificates of all hold."""
    for stage in stages.values():
        stage.require_limits()
    for percent, stage in stages.items():
        stem = _stem(base, percent)
        files = [str(export_trajectory(stage, stem, kind, rate, unchecked)) for kind in kinds]
        say(f"exported: {', '.join(files)}, {stem}{CERTIFICATE}")


def _stem(base: Path, percent: float) -> Path:
    """Path without suffix of the files of one speed."""
    return base if percent == 100 else base.with_name(f"{base.name}-speed{percent:g}")


def json_path(path: Path) -> Path:
    """The path itself, which must end in .json."""
    if path.suffix != ".json":
        raise RuntimeFault(
            f"the trajectory needs a file that ends in .json, got '{path}'; "
            "the sampled motion is written beside it as .csv"
        )
    return path
