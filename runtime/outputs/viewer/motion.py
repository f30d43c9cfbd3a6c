"""What is played: a designed trajectory or a recording, at any instant."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.errors import RecordingError
from runtime.excitation.trajectory_file import read_trajectory
from runtime.library import Array, Library
from runtime.recording import read_recording

RATE_HZ = 100.0
"""Of a trajectory's samples."""
TRAJECTORY = ".json"


@dataclass(frozen=True, slots=True)
class PlayedMotion:
    """q, dq and τ (N, n) at t (N,) from 0 on; dq or τ is None where nobody knows it."""

    name: str
    t: Array
    q: Array
    dq: Array | None
    tau: Array | None

    @property
    def duration(self) -> float:
        """s."""
        return float(self.t[-1])

    def at(self, t: float) -> tuple[Array, Array | None, Array | None]:
        """q, dq and τ at t, (n,) each, straight between samples."""
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
    """A trajectory of `excite` (.json; torque by the URDF's inertia), else a recording.

    Raises:
        RecordingError: not to be read, or of another robot.
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
            f"'{source}' moves {log.q.shape[1]} joints, '{lib.name}' has {lib.n_joints}; name its "
            "robot with --robot"
        )
    if not np.isfinite(log.q).all():
        raise RecordingError(f"'{source}' holds positions that are not finite; mend the log")
    return PlayedMotion(log.name or path.name, log.t - log.t[0], log.q, log.dq, log.tau)
