"""`symgen approach`, and --from and --return of `symgen excite`: the way to a motion, and back."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from runtime.cli.common import Overwrite, Robot, Seed, Yes, numbers_option, open_robot, sentences_of
from runtime.cli.motion_limits import (
    Box,
    Carry,
    Clearance,
    Coulomb,
    FrictionBand,
    LimitValues,
    ModelBand,
    Obstacles,
    PayloadBand,
    Table,
    TorqueFraction,
    Unchecked,
    Viscous,
    safety_of,
    table_height,
)
from runtime.cli.motion_output import (
    EXPORT_MARGIN,
    ROWS_HZ,
    SAMPLED,
    certified_stages,
    export_stages,
    files_of,
    json_path,
    stage_speeds,
    write_motion_log,
)
from runtime.common.files import require_unused
from runtime.common.settings import Choices
from runtime.common.terminal import completing, say
from runtime.errors import RecordingError, RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import TABLE, Safety, require_consent
from runtime.excitation.limits.safety import unchecked as unchecked_limits
from runtime.excitation.motion.trajectory import WAYS, JoinedMotion, joined
from runtime.excitation.motion_export import MOTION_FORMATS
from runtime.excitation.proof.certified_motion import certified
from runtime.excitation.trajectory_file import read_trajectory, write_motion
from runtime.excitation.way import Way, way_back, way_to
from runtime.library import Array, Library
from runtime.recording import read_recording
from runtime.simulation import sample_times

HOME = "home"
"""Value of --from for the home of the robot."""
FROM = (
    "Present pose, from which the way to the start is planned under the same limits: home, one "
    "number per joint with commas (rad or m), or a log, whose last row counts."
)
FromPose = Annotated[str | None, typer.Option("--from", metavar="POSE", help=FROM)]
Return = Annotated[
    bool, typer.Option("--return", help="Go back to the pose of --from after the motion.")
]


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """Ways around a motion.

    Attributes:
        there: way to its start; None without --from.
        back: way from its end; None without --return.
    """

    there: Way | None = None
    back: Trajectory | None = None

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
    text: str | None,
    returns: bool,
    start: Array | None,
    safety: Safety | None,
    share: float = 1.0,
    zero_jerk: bool = False,
    seed: int = 0,
) -> SessionPlan:
    """Ways of --from and --return.

    start (n,) [rad, m].
    """
    if text is None or safety is None:
        if returns:
            raise RuntimeFault(
                "--return goes back to the pose of --from; give --from POSE too, such as home"
            )
        return SessionPlan()
    there = lib.home if start is None else start
    way = way_to(lib, pose_of(lib, text), there, safety, share, zero_jerk, seed)
    if not returns or way.trajectory is None:
        return SessionPlan(way)
    return SessionPlan(way, way_back(lib, way.trajectory, safety, share))


def pose_of(lib: Library, text: str) -> Array:
    """Pose of --from.

    Returns (n,) [rad, m].
    """
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
class ApproachSettings(Choices):
    """Settings of `symgen approach`."""

    command = "approach"
    options = "robot from_pose returns table obstacles carry export speed out overwrite"
    motion: Annotated[Path, typer.Argument(metavar="MOTION", help="JSON of excite.")]
    from_pose: Annotated[str, typer.Option("--from", metavar="POSE", help=FROM)]
    robot: Robot = "fr3"
    yes: Yes = False
    returns: Return = False
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="JSON of ways and motion; default results/ROBOT-approach.json."
        ),
    ] = None
    export: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FORMAT",
            autocompletion=completing(MOTION_FORMATS),
            help="Files for a robot with ways and motion in one, written only if the certificate "
            f"holds; repeatable. {sentences_of(MOTION_FORMATS)}.",
        ),
    ] = None
    export_rate: Annotated[
        float | None,
        typer.Option(help="Rate of the rows of files, Hz; default 1000, for ros 25."),
    ] = None
    speed: Annotated[
        list[float] | None,
        typer.Option(help="Speed of a stage in % of the planned speed; repeatable. Default 100."),
    ] = None
    margin: Annotated[
        float, typer.Option(help="Share of the limits that the ways may use, 0 to 1.")
    ] = EXPORT_MARGIN
    table: Table = None
    unchecked: Unchecked = None
    box: Box = None
    clearance: Clearance = None
    carry: Carry = None
    obstacles: Obstacles = None
    torque_fraction: TorqueFraction = 0.95
    viscous: Viscous = None
    coulomb: Coulomb = None
    payload_band: PayloadBand = None
    friction_band: FrictionBand = None
    model_band: ModelBand = None
    seed: Seed = 0
    overwrite: Overwrite = False


def approach_command(given: ApproachSettings) -> None:
    r"""Plan the way to the start of a motion and back.

    \b
    symgen approach motion.json --from home --return --table 0
    symgen approach motion.json --from last.npz --table 0 --obstacles cell.toml --export ros

    The way is straight in the joints, or leads around links, table and obstacles. It keeps the
    limits of the motion: position, velocity, acceleration, jerk, torque and its rate, speed of the
    tip, distances. --return goes the same way back. One certificate counts ways and motion.

    Written: JSON of ways and motion, and all of it sampled as CSV or in the formats of --export.
    """
    lib = open_robot(given.robot, given.yes)
    height, has_no_table = table_height(given.table)
    limits = LimitValues(
        given.torque_fraction,
        clearance=given.clearance,
        table=height,
        box=given.box,
        viscous=given.viscous,
        coulomb=given.coulomb,
        carry=given.carry,
        obstacles=given.obstacles,
        payload_band=given.payload_band,
        friction_band=given.friction_band,
        model_band=given.model_band,
    )
    safety = safety_of(lib, limits)
    path = json_path(given.out or Path("results") / f"{lib.name}-approach.json")
    trajectory = read_trajectory(given.motion, lib)
    rate = ROWS_HZ if given.export_rate is None else given.export_rate
    sample_times(trajectory.duration, rate)  # before the search: they may be too many
    formats = [MOTION_FORMATS[name].name for name in given.export or []]
    accepted = [*(given.unchecked or ()), *([TABLE] if has_no_table else [])]
    if formats:
        require_consent(unchecked_limits(lib, safety), accepted)
    speeds = stage_speeds(trajectory.duration, given.speed or [100.0])
    require_unused(files_of(path, formats, given.speed or [100.0], False), given.overwrite)
    zero_jerk = trajectory.basis.zero_jerk
    ways = session_plan(
        lib,
        given.from_pose,
        given.returns,
        trajectory.home,
        safety,
        given.margin,
        zero_jerk,
        given.seed,
    )
    session = certified(lib, ways.around(trajectory), safety)
    write_motion(trajectory, lib, path, ways=ways.parts)
    written = [path]
    if not formats:
        log, sentence = path.with_suffix(SAMPLED), "Ways and motion planned by symgen."
        written.append(write_motion_log(session, rate, log, sentence))
    for sentence in ways.sentences(trajectory):
        say(sentence)
    stages = certified_stages(session, speeds)
    say(f"trajectory: {', '.join(map(str, written))}")
    if formats:
        export_stages(stages, path.with_suffix(""), formats, given.export_rate, accepted)
    given.write(path)
