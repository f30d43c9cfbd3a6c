"""The options --from and --return: the way to the start of a motion, and back."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from runtime.cli.common import numbers_option
from runtime.errors import RecordingError, RuntimeFault
from runtime.excitation import Safety, Trajectory
from runtime.excitation.approach.way import Way, way_back, way_to
from runtime.excitation.motion.joined import WAYS, JoinedMotion, joined
from runtime.library import Array, Library
from runtime.recording import read_recording

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
    log = read_recording(Path(text))
    if log.q.shape[1] != lib.n_joints:
        raise RecordingError(
            f"the log '{text}' has {log.q.shape[1]} joints and '{lib.name}' {lib.n_joints}; give a "
            "log of this robot or the numbers of the pose"
        )
    return np.asarray(log.q[-1], dtype=float)
