"""A motion that was planned or recorded, as the samples that identification would take from it."""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.problem import Problem
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.excitation import Trajectory
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.plausibility import require_motion, require_plausible
from runtime.recording.preprocessing import prepare

STILL = 1e-3
"""Range in rad or m within which a joint stands still."""


@dataclass(frozen=True, slots=True)
class MotionSamples:
    """Samples of a motion, equally spaced in time.

    Attributes:
        name: of the file.
        samples: τ is 0 where none was measured.
        terms: friction columns asked for.
        columns: names of those that there are; some recordings bring their own.
        rate: Hz.
        measured: τ is a measured torque.
    """

    name: str
    samples: Samples
    terms: Friction
    columns: tuple[str, ...]
    rate: float
    measured: bool

    @property
    def seconds(self) -> float:
        """How long it takes: every sample stands for 1/rate."""
        return len(self.samples) / self.rate

    def statistics(self, lib: Library, noise: Array, seconds: float | None = None) -> Statistics:
        """Rows over their noise of the whole motion, or of its first seconds.

        Beyond its end it begins again, as often as needed.
        """
        own = None
        if seconds is not None:
            rows, count = len(self.samples), round(seconds * self.rate)
            own = np.full(rows, float(count // rows))
            own[: count % rows] += 1.0
        return compress(lib, self.samples, 1 / noise**2, own)

    def require_columns(self, columns: tuple[str, ...]) -> None:
        """Refuse to be joined to a motion with other friction columns.

        Raises:
            IdentificationError: so it is.
        """
        if self.columns != columns:
            raise IdentificationError(
                f"'{self.name}' has the friction columns {', '.join(self.columns) or 'none'}, the "
                f"motion before it {', '.join(columns) or 'none'}; give both the same (--friction)"
            )


@dataclass(frozen=True, slots=True)
class Noise:
    """What residuals of a log say of its noise.

    Attributes:
        sigma: s_j, (n,) N·m or N.
        inflation: N / N_eff, of correlated residuals.
        pi: most probable bodies, (10 n,).
    """

    sigma: Array
    inflation: float
    pi: Array


def planned_recording(trajectory: Trajectory, t: Array, lib: Library, name: str) -> Recording:
    """A trajectory at times t as a recording without torque."""
    q, dq, ddq, _ = trajectory.at(lib, t)
    return Recording(t, q, dq, ddq, name=name, joint_names=lib.joint_names)


def motion_samples_of(
    recording: Recording,
    lib: Library,
    preparation: Preparation | None,
    terms: Friction,
) -> MotionSamples:
    """Samples of a recording, prepared as for identification; its torque may be missing.

    Raises:
        RuntimeFault: no motion of this robot.
    """
    measured = recording.tau is not None and bool(recording.tau.any())
    if measured:
        require_plausible(recording, lib)
    else:
        require_motion(recording, lib)
        recording = recording.replace(tau=np.zeros_like(recording.q))
    if np.ptp(recording.q, axis=0).max() < STILL:
        raise IdentificationError(
            f"nothing moves in '{recording.name}': every joint keeps its place to {STILL:g}; "
            "give a motion (python -m runtime excite designs one)"
        )
    own = (terms,) if recording.columns is None else ()
    done = prepare(recording, preparation, *own, lib=lib)
    samples = samples_of(done, lib)
    return MotionSamples(recording.name, samples, terms, done.column_names, done.rate_hz, measured)


def noise_of(lib: Library, moved: MotionSamples, kappa: float = CAD) -> Noise | None:
    """Noise of a log by the most probable model; None where there is no torque, or too little."""
    samples = moved.samples
    unknowns = len(lib.base_columns) + samples.columns[0].size
    if not moved.measured or samples.tau.size <= unknowns:
        return None
    weights = thesis_weights(samples.tau)
    fit = fit_map(Problem(lib, samples, samples.rows(slice(0, 1)), weights, lib.lam0), kappa)
    row_weights, noise = fit.noise()
    return Noise(np.sqrt(noise.variance / row_weights), noise.inflation, fit.pi)
