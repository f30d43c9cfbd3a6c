"""A designed trajectory or a recording, interpolated at any time."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.excitation.trajectory_file import read_trajectory
from runtime.library import Array, Library
from runtime.recording import read_recording

RATE_HZ = 100.0
"""Sample rate of a trajectory [Hz]."""
TRAJECTORY = ".json"


@dataclass(frozen=True, slots=True)
class PlayedMotion:
    """Motion that the viewer plays.

    Attributes:
        name: shown above the controls.
        t: (N,) time from 0 [s].
        q: (N, n) joint positions [rad, m].
        dq: (N, n) joint velocities [rad/s, m/s]; None where unknown.
        tau: (N, n) torques [N·m, N]; None where unknown.
    """

    name: str
    t: Array
    q: Array
    dq: Array | None
    tau: Array | None

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.t[-1])

    def at(self, t: float) -> tuple[Array, Array | None, Array | None]:
        """q, dq and τ at the time t [s], (n,) each, by linear interpolation."""
        k = int(np.clip(np.searchsorted(self.t, t) - 1, 0, max(len(self.t) - 2, 0)))
        step = self.t[k + 1] - self.t[k] if len(self.t) > 1 else 1.0
        share = float(np.clip((t - self.t[k]) / step, 0.0, 1.0))

        def between(values: Array) -> Array:
            following = values[min(k + 1, len(values) - 1)]
            return np.asarray((1 - share) * values[k] + share * following)

        dq = None if self.dq is None else between(self.dq)
        tau = None if self.tau is None else between(self.tau)
        return between(self.q), dq, tau


def read_motion(
    source: str, lib: Library, recipe: str | None = None, run: str | None = None
) -> PlayedMotion:
    """Read a trajectory of `excite` or a recording.

    Args:
        source: .json of a trajectory, whose torque follows from the parameters of the URDF; else
            a log.
        lib: the robot.
        recipe: layout of the log, see `read_recording`.
        run: which run of the log.

    Returns:
        The motion.

    Raises:
        RecordingError: the file cannot be read, or belongs to another robot.
    """
    path = Path(source)
    if path.suffix == TRAJECTORY:
        trajectory = read_trajectory(path, lib)
        t = np.linspace(0, trajectory.duration, 1 + round(trajectory.duration * RATE_HZ))
        q, dq, ddq, _ = trajectory.at(lib, t)
        return PlayedMotion(path.name, t, q, dq, lib.inverse_dynamics(q, dq, ddq, lib.pi0))
    log = read_recording(source, recipe, run)
    if log.q.shape[1] != lib.n_joints:
        raise RecordingError(
            f"expected {lib.n_joints} joints of '{lib.name}', got {log.q.shape[1]} in '{source}'; "
            "name the robot with --robot"
        )
    if not np.isfinite(log.q).all():
        raise RecordingError(
            f"expected finite positions in '{source}', got NaN or infinity; correct the log"
        )
    return PlayedMotion(log.name or path.name, log.t - log.t[0], log.q, log.dq, log.tau)
