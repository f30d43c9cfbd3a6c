"""Samples that identification takes from a planned or recorded motion, and from earlier logs.

The information of earlier logs is G₀ = Σ Y_bᵀ diag(σ⁻²) Y_b over their samples, less the part that
friction explains (the Schur complement of its columns, by orthogonal transformations). G₀ is an
inverse covariance of β.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.factor import Statistics, compress
from runtime.estimators.regression.samples import Samples, residuals, samples_of, thesis_weights
from runtime.excitation import Trajectory
from runtime.excitation.search.information import FRICTION
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.consistency import require_motion, require_plausible
from runtime.recording.preprocessing import prepare
from runtime.recording.rest_speeds import STILL

MIRRORED = 0.05
"""Largest distance of the way back from the way out, over the range of the joint: controllers
repeat a path within 1 %."""


@dataclass(frozen=True, slots=True)
class MotionSamples:
    """Samples of a motion, equally spaced in time."""

    name: str  # name of the file
    samples: Samples  # prepared samples; τ is 0 where none was measured
    terms: Friction  # requested friction columns
    columns: tuple[str, ...]  # friction columns of the samples; a recording may have others
    rate: float  # rate of the samples, Hz
    measured: bool  # True when τ is a measured torque
    replaces_power: bool = False  # the recipe states rows of power, these are of momentum

    @property
    def seconds(self) -> float:
        """Duration [s]; every sample counts 1/rate."""
        return len(self.samples) / self.rate

    def statistics(
        self, lib: Library, noise: Array, seconds: float | None = None, only: int | None = None
    ) -> Statistics:
        """Factor of the rows over their noise: noise (n,) N·m or N."""
        weights = 1 / noise**2
        if only is not None:
            weights = np.where(np.arange(len(noise)) == only, weights, 0.0)
        repeats = None
        if seconds is not None:
            rows, count = len(self.samples), round(seconds * self.rate)
            repeats = np.full(rows, float(count // rows))
            repeats[: count % rows] += 1.0
        return compress(lib, self.samples, weights, repeats)

    def require_columns(self, columns: tuple[str, ...]) -> None:
        """Refuse two motions with different friction columns."""
        if self.columns != columns:
            raise IdentificationError(
                f"'{self.name}' has the friction columns {', '.join(self.columns) or 'none'}, the "
                f"motion before it {', '.join(columns) or 'none'}; give both the same (--friction)"
            )


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of a log, from the residuals of its most probable model."""

    sigma: Array  # s_j, (n,) N·m or N
    inflation: float  # N / N_eff of correlated residuals, those of the way out and back included
    fit: Fit  # the model
    rest: Array  # residuals, (N, n) [N·m, N]
    repeated: float  # rows that count as one because a motion out and back repeats model error


def planned_recording(trajectory: Trajectory, t: Array, lib: Library, name: str) -> Recording:
    """A trajectory as a recording without torque: t (N,) instants, s."""
    q, dq, ddq, _ = trajectory.at(lib, t)
    return Recording(t, q, dq, ddq, name=name, joint_names=lib.joint_names)


def motion_samples_of(
    recording: Recording, lib: Library, preparation: Preparation | None, terms: Friction
) -> MotionSamples:
    """Samples of a recording, prepared as for identification; its torque may be missing."""
    measured = recording.tau is not None and bool(recording.tau.any())
    if measured:
        require_plausible(recording, lib)
    else:
        require_motion(recording, lib)
        recording = recording.replace(tau=np.zeros_like(recording.q))
    if np.ptp(recording.q, axis=0).max() < STILL:
        raise IdentificationError(
            f"nothing moves in '{recording.name}': every joint stays within {STILL:g} rad or m; "
            "give a motion (python -m runtime excite designs one)"
        )
    added = (terms,) if recording.columns is None else ()
    done = prepare(recording, preparation, *added, lib=lib)
    samples = samples_of(done, lib)
    replaces = (preparation or recording.preparation).regressor == "energy"
    return MotionSamples(
        *(recording.name, samples, terms, done.column_names, done.rate_hz, measured, replaces)
    )


def noise_of(lib: Library, moved: MotionSamples, kappa: float = CAD) -> Noise | None:
    """Noise of a log, from the residuals of the most probable model."""
    samples = moved.samples
    unknowns = len(lib.base_columns) + samples.columns[0].size
    if not moved.measured or samples.tau.size <= unknowns:
        return None
    weights = thesis_weights(samples.tau)
    fit = fit_map(Problem(lib, samples, samples.rows(slice(0, 1)), weights, lib.lam0), kappa)
    row_weights, noise = fit.noise()
    rest = residuals(lib, samples, fit.pi, fit.phi)
    repeated = 1.0 + repetition(samples.q, rest * np.sqrt(row_weights))
    sigma = np.sqrt(noise.variance / row_weights)
    return Noise(sigma, noise.inflation * repeated, fit, rest, repeated)


def repetition(q: Array, rest: Array) -> float:
    """Correlation r of the residuals on the way out with those on the way back, 0 for noise.

    Model error has the same sign both times a state is passed: the mean of both has the variance
    (1 + r)/2 and not 1/2.
    """
    spans = np.ptp(q, axis=0)
    moving = spans > STILL
    way, energy = np.abs(q - q[::-1])[:, moving] / spans[moving], float(np.sum(rest**2))
    if not moving.any() or way.max() > MIRRORED or energy == 0.0:
        return 0.0
    return max(0.0, float(np.sum(rest * rest[::-1])) / energy)


def information_of_logs(
    lib: Library, logs: Sequence[Recording], noise: Array, friction: tuple[str, ...] = FRICTION
) -> Array:
    """Information G₀ on β in earlier logs: noise (n,) → (n_b, n_b)."""
    total = np.zeros((len(lib.base_columns),) * 2)
    for recording in logs:
        require_plausible(recording, lib)
        terms = recording.recipe.friction if recording.recipe else None
        if recording.columns is not None:
            terms = Friction(())
        samples = samples_of(prepare(recording, None, terms or Friction(friction), lib=lib), lib)
        if not len(samples):
            raise IdentificationError(
                f"the log '{recording.name}' has no samples left after its preparation; "
                "leave out this log of earlier_log"
            )
        statistics = compress(lib, samples, 1 / noise**2)
        size = len(statistics.target)
        # The columns of β come last in the triangle: their block is the Schur complement.
        first = size - statistics.n_base
        block = statistics.triangle()[first:size, first:size]
        total += block.T @ block
    return total


def with_earlier(rows: Array, earlier: Array | None, lib: Library) -> Array:
    """Rows over π (m, 10 n) with those of information on β (n_b, n_b)."""
    if earlier is None:
        return rows
    values, vectors = np.linalg.eigh(earlier)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return np.vstack([rows, root @ lib.base_matrix])
