"""`symgen approach`, and --from and --return of `symgen excite`: the way to a motion, and back."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.cli.common import numbers_option, open_robot
from runtime.cli.motion_output import EXPORT_MARGIN, FROM, MotionChoices, json_path
from runtime.common.settings import argument_field, method_field, output_field
from runtime.common.terminal import say
from runtime.errors import RecordingError, RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import WAYS, JoinedMotion, joined
from runtime.excitation.proof.certificate import certified
from runtime.excitation.trajectory_file import read_trajectory, write_motion
from runtime.excitation.way import Way, way_back, way_to
from runtime.library import Array, Library
from runtime.recording import read_recording

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
    way = way_to(lib, pose_of(lib, given.from_pose), there, safety, share, zero_jerk, given.seed)
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
