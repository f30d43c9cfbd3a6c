"""Ways and files of planned motions: samples, certified stages, exports; `symgen approach`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.cli.common import Overwrite, Seed, numbers_option, open_robot, sentences_of
from runtime.cli.motion_limits import LimitChoices
from runtime.common.files import require_unused
from runtime.common.settings import argument_field, method_field, output_field, settings_place
from runtime.common.tables import Table
from runtime.common.terminal import completing, say, show
from runtime.errors import RecordingError, RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.distance_limits import OBSTACLE
from runtime.excitation.limits.safety import Safety, require_consent
from runtime.excitation.limits.safety import unchecked as unchecked_limits
from runtime.excitation.motion.trajectory import (
    LONGEST,
    WAYS,
    JoinedMotion,
    joined,
    read_trajectory,
    require_speed,
    write_motion,
)
from runtime.excitation.motion_export import CERTIFICATE, MOTION_FORMATS, export_trajectory
from runtime.excitation.proof.certificate import (
    DISTANCES,
    Certificate,
    CertifiedMotion,
    Use,
    certified,
)
from runtime.excitation.way import Way, way_back, way_to
from runtime.library import Array, Library
from runtime.outputs.report.motion_figures import picture_paths
from runtime.recording import Recording, read_recording, write_recording
from runtime.simulation import sample_times

FROM = (
    "Present pose, from which the way to the start is planned under the same limits: home, one "
    "number per joint with commas (rad or m), or a log, whose last row counts."
)
EXPORT_MARGIN = 0.95  # default share of the limits that an exported motion uses
SAMPLED = ".motion.csv"  # end of the name of the sampled motion, apart from that of its log
ROWS_HZ = 1000.0  # default rate of the sampled motion


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionChoices(LimitChoices):
    """Limits of a motion, and its files for a robot.

    Args:
        lib: library of the robot.
        duration: of the motion, s.
        safety: limits of the motion; None for those of the document.
        motion: certified motion.
        path: JSON of the motion.
        pictures: whether pictures are among its files.
        written: files that are written already.
        sentence: history of the log.
    """

    from_pose: str | None = method_field(None, "--from", metavar="POSE", help=FROM)
    returns: bool = method_field(
        False, "--return", help="Go back to the pose of --from after the motion."
    )
    export: list[str] | None = output_field(
        metavar="FORMAT",
        autocompletion=completing(MOTION_FORMATS),
        help="Files for a robot with ways and motion in one, written only if the certificate "
        f"holds; repeatable. {sentences_of(MOTION_FORMATS)}.",
    )
    export_rate: float | None = output_field(
        help="Rate of the rows of files, Hz; default 1000, for ros 25. libfranka has 1000 Hz "
        "always."
    )
    speed: list[float] | None = output_field(
        help="Speed of a stage in % of the designed speed, on the same path; "
        "repeatable, each with its own certificate: 10, 50 and 100 are three stages to try on "
        "a robot. File names end in -speed10. Default 100."
    )
    seed: Seed = 0
    overwrite: Overwrite = False

    @property
    def percents(self) -> list[float]:
        """Speeds of the stages in % of the designed speed."""
        return self.speed or [100.0]

    @property
    def rate(self) -> float:
        """Rate of the sampled motion, Hz."""
        return ROWS_HZ if self.export_rate is None else self.export_rate

    def require_possible(self, lib: Library, duration: float, safety: Safety | None) -> None:
        """Refuse, before a search, samples, formats and exports that would be refused after it."""
        sample_times(duration, self.rate)
        formats = [MOTION_FORMATS[name].name for name in self.export or ()]
        if formats:
            require_consent(unchecked_limits(lib, safety), self.accepted)
        slowest = min(require_speed(percent / 100) for percent in self.percents)
        if duration / slowest > LONGEST:
            raise RuntimeFault(
                f"expected stages up to {LONGEST:g} s, but --speed {100 * slowest:g} makes the "
                f"motion of {duration:g} s {duration / slowest:.3g} s long; give a larger --speed"
            )

    def require_new(self, path: Path, pictures: bool = False) -> None:
        """Refuse to replace files of a motion without consent."""
        files = [path, settings_place(path)]
        if pictures:
            files += picture_paths(path.with_suffix(".png"))
        if not self.export:
            files.append(path.with_suffix(SAMPLED))
        suffixes = [*(MOTION_FORMATS[name].suffix for name in self.export or ()), CERTIFICATE]
        for stem in [_stem(path, percent) for percent in self.percents] if self.export else []:
            files += [stem.with_name(stem.name + suffix) for suffix in suffixes]
        consent = "--overwrite" if "overwrite" in self.options else "--settings overwrite=true"
        require_unused(files, self.overwrite, consent=consent)

    def write_samples(self, motion: CertifiedMotion, path: Path, sentence: str) -> list[Path]:
        """Write the motion, sampled, where no format of a robot is given.

        Returns:
            The file, or nothing.
        """
        if self.export:
            return []
        path = path.with_suffix(SAMPLED)
        t = sample_times(motion.trajectory.duration, self.rate)
        q, dq, ddq, _ = motion.trajectory.at(motion.lib, t)
        names = motion.lib.joint_names
        log = Recording(t, q, dq, ddq, name=path.stem, joint_names=names, history=(sentence,))
        write_recording(log, path)
        return [path]

    def write_stages(self, motion: CertifiedMotion, path: Path, written: Sequence[Path]) -> None:
        """Print the certificate of every stage and the files; write those for a robot.

        They are written of every stage, or of none unless the certificates of all hold.
        """
        stages = certified_stages(motion, self.percents)
        say(f"trajectory: {', '.join(map(str, written))}")
        if not self.export:
            return
        for stage in stages.values():
            stage.require_limits()
        for percent, stage in stages.items():
            stem, how = _stem(path, percent), (self.export_rate, self.accepted)
            files = [str(export_trajectory(stage, stem, kind, *how)) for kind in self.export]
            say(f"exported: {', '.join(files)}, {stem}{CERTIFICATE}")


def certified_stages(
    motion: CertifiedMotion, percents: Sequence[float]
) -> dict[float, CertifiedMotion]:
    """Print the certificate of every stage: the same path at a fraction of the speed."""
    stages = {}
    for percent in percents:
        stage = motion
        if percent != 100:
            stage = certified(motion.lib, motion.trajectory.slowed(percent / 100), motion.safety)
        stages[percent] = stage
    for percent, stage in stages.items():
        for line in certificate_headline(stage.certificate, percent):
            say(line)
        show(certificate_table(stage.certificate))
    return stages


def _stem(path: Path, percent: float) -> Path:
    """Path without suffix of the files of one speed, beside the JSON."""
    base = path.with_suffix("")
    return base if percent == 100 else base.with_name(f"{base.name}-speed{percent:g}")


def json_path(path: Path) -> Path:
    """The path itself, which must end in .json."""
    if path.suffix != ".json":
        raise RuntimeFault(
            f"the trajectory needs a file that ends in .json, got '{path}'; "
            f"the sampled motion is written beside it as {SAMPLED}"
        )
    return path


def certificate_headline(proof: Certificate, percent: float) -> tuple[str, ...]:
    """What a certificate states in two sentences: the limits that hold, and what it leaves out."""
    verdict = "holds at every instant" if proof.holds else "does NOT hold"
    checked = ", ".join(use.kind for use in proof.uses)
    others = "other obstacles" if any(use.kind == OBSTACLE for use in proof.uses) else "obstacles"
    missing = ", ".join((*proof.unchecked, "cables", "people", others))
    return (
        f"certificate at {percent:g} % speed: {verdict}; checked: {checked}",
        f"load: {proof.load}; NOT checked: {missing}",
    )


def certificate_table(proof: Certificate) -> Table:
    """Largest use of every limit: how much, where and when, and how it is shown."""
    return Table(
        ("limit", "use %", "margin %", "where", "time s", "intervals"),
        (
            *(
                (
                    *(u.kind, *_amount(u), u.where, f"{u.time:.3f}"),
                    str(u.intervals) if u.is_proven else "measured",
                )
                for u in proof.uses
            ),
            *((missing, "", "", "no limit stated", "", "") for missing in proof.unlimited),
            *((missing, "", "", "NOT checked", "", "") for missing in proof.unchecked),
        ),
    )


def _amount(use: Use) -> tuple[str, str]:
    if use.kind in DISTANCES:
        # Rounded downwards, so that 19.996 mm is not printed as 20.00 mm.
        distance = np.floor(1e5 * use.value + 1e-6) / 100
        return f"{distance:.2f} mm", f"{distance - 1e3 * use.limit:.2f} mm"
    # Rounded upwards, so that 100.004 % is not printed as 100.00 %.
    bound = np.ceil(1e4 * use.bound - 1e-6) / 100
    return f"{bound:.2f}", f"{100 - bound:.2f}"


HOME = "home"  # value of --from for the home of the robot


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """Ways around a motion."""

    there: Way | None = None  # way to its start; None without --from
    back: Trajectory | None = None  # way from its end; None without --return

    @property
    def parts(self) -> dict[str, Trajectory]:
        """The ways by the names of their parts."""
        approach = self.there.trajectory if self.there else None
        both = zip(WAYS, (approach, self.back), strict=True)
        return {name: way for name, way in both if way is not None}

    def around(self, motion: Trajectory) -> Trajectory | JoinedMotion:
        """The motion with its ways; the motion itself where there are none."""
        if not self.parts:
            return motion
        return joined(self.parts.get(WAYS[0]), motion, self.parts.get(WAYS[1]))

    def sentences(self, motion: Trajectory) -> tuple[str, ...]:
        """Durations of the parts; empty without --from."""
        if self.there is None:
            return ()
        if self.there.trajectory is None:
            return ("the robot stands at the start of the motion: no way there or back is needed",)
        count = self.there.corners
        path = "straight" if not count else f"around obstacles with {count} corners"
        both = f"{self.there.trajectory.duration:.3g} s to the start ({path}), "
        both += f"{motion.duration:.4g} s of motion"
        return (both + (f", {self.back.duration:.3g} s back" if self.back else ""),)


def session_plan(
    lib: Library,
    given: MotionChoices,
    start: Array | None,
    safety: Safety | None,
    share: float,
    zero_jerk: bool,
) -> SessionPlan:
    """Ways of --from and --return; start: (n,) [rad, m]."""
    if given.from_pose is None or safety is None:
        if given.returns:
            raise RuntimeFault(
                "--return goes back to the pose of --from; give --from POSE too, such as home"
            )
        return SessionPlan()
    there = lib.home if start is None else start
    here = pose_of(lib, given.from_pose)
    way = way_to(lib, here, there, safety, share, zero_jerk, given.seed)
    if not given.returns or way.trajectory is None:
        return SessionPlan(way)
    return SessionPlan(way, way_back(lib, way.trajectory, safety, share))


def pose_of(lib: Library, text: str) -> Array:
    """Pose of --from, (n,) [rad, m]."""
    if text == HOME:
        return lib.home
    if not Path(text).suffix or not Path(text).exists():
        q = np.array(numbers_option(text, lib.n_joints, "--from"))
        if not np.isfinite(q).all():
            raise RuntimeFault(f"--from needs finite numbers, got '{text}'")
        return q
    log = read_recording(Path(text), joints=lib.joint_names)
    if log.q.shape[1] != lib.n_joints:
        raise RecordingError(
            f"the log '{text}' has {log.q.shape[1]} joints and '{lib.name}' {lib.n_joints}; give a "
            "log of this robot or the numbers of the pose"
        )
    return np.asarray(log.q[-1], dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class ApproachSettings(MotionChoices):
    """Settings of `symgen approach`."""

    options = "robot from_pose returns table obstacles carry export speed out overwrite"
    motion: Path = argument_field(metavar="MOTION", help="JSON of excite.")
    from_pose: str = method_field(..., "--from", metavar="POSE", help=FROM)
    out: Path | None = output_field(
        metavar="FILE", help="JSON of ways and motion; default results/ROBOT-approach.json."
    )
    margin: float = method_field(
        EXPORT_MARGIN, help="Share of the limits that the ways may use, 0 to 1."
    )


def approach_command(given: ApproachSettings) -> None:
    r"""Plan the way to the start of a motion and back.

    \b
    symgen excite --duration 5 --table 0 --settings starts=1 --out results/motion.json
    symgen approach results/motion.json --from 0.2,-0.5,0,-2,0,1.8,0.5 --return --table 0
    symgen approach motion.json --from home --return --table 0
    symgen approach motion.json --from last.npz --table 0 --obstacles cell.toml --export ros

    The way is straight in the joints, or leads around links, table and obstacles. It keeps the
    limits of the motion: position, velocity, acceleration, jerk, torque and its rate, speed of the
    tip, distances. --return goes the same way back. One certificate counts ways and motion.

    Written: JSON of ways and motion, and all of it sampled as CSV or in the formats of --export.
    """
    lib = open_robot(given.robot, given.yes)
    safety = given.limits(lib)
    path = json_path(given.out or Path("results") / f"{lib.name}-approach.json")
    motion = read_trajectory(given.motion, lib)
    given.require_possible(lib, motion.duration, safety)
    given.require_new(path)
    home, zero_jerk = motion.home, motion.basis.zero_jerk
    ways = session_plan(lib, given, home, safety, given.margin, zero_jerk)
    session = certified(lib, ways.around(motion), safety)
    write_motion(motion, lib, path, ways=ways.parts)
    samples = given.write_samples(session, path, "Ways and motion planned by symgen.")
    for sentence in ways.sentences(motion):
        say(sentence)
    given.write_stages(session, path, [path, *samples])
    given.write(path)
