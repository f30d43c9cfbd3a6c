"""Online identification: a triangular factor of fixed size, and from it the present model.

    RᵀR ← ϑ RᵀR + [F Y_b τ]ᵀ W [F Y_b τ]      one rank-n update per sample, ϑ the forgetting factor

After every fixed number of samples the most probable consistent model is computed, started from the
last one, with γ = κ s²/N and N = Σ ϑⁱ. With ϑ = 1 a replayed log gives the result of the whole log.
The same in plain C is `<robot>_online_*` (generated/<robot>/online.c), without friction columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, Prior, prior_of
from runtime.estimators.convex.newton import convex_problem, task_of
from runtime.estimators.regression.factor import Statistics, compress, from_triangle, reduce
from runtime.estimators.regression.samples import Samples
from runtime.identification.expected_accuracy import expected as accuracy
from runtime.library import Array, Library
from runtime.library.compiled_descent import CompiledConvex

DECREMENT, MOST_STEPS = 1e-12, 50
"""Newton's tolerance in units of γ, 1e-5 of a standard deviation from the minimum, and its limit of
steps."""
PERFECT = 1e-12  # squared noise over squared torque below which data count as exact


@dataclass(frozen=True, slots=True)
class OnlineEstimate:
    """The model after some samples.

    Attributes:
        pi: standard parameters, (10 n,), strictly consistent.
        phi: friction coefficients, (n, k).
        samples: N, less the forgotten ones.
        rejected: number of samples left out because they were not finite.
        variance: s² of the weighted residual; 1 where the weights are 1/σ².
        steps: number of Newton steps.
        converged: whether Newton reached its tolerance.
        status: one sentence.
    """

    pi: Array
    phi: Array
    samples: float
    rejected: int
    variance: float
    steps: int
    converged: bool
    status: str


class OnlineEstimator:
    """RᵀR ← ϑ RᵀR + [F Y_b τ]ᵀ W [F Y_b τ] with every sample; the model after every few.

    Args:
        lib: library of the robot.
        weights: diagonal of W, (n,), best 1/σ_j² of the torque sensors; None for ones.
        columns: k, number of friction columns per joint that come with the samples.
        forgetting: ϑ per sample, in (0, 1]; 0.999 at 100 Hz has a memory of ten seconds.
        every: number of samples between two models.
        kappa: weight of the first guess, 16 for a URDF from CAD.
        first: π of the first guess, (10 n,); None is the URDF's.

    Raises:
        IdentificationError: an argument is out of its range.
    """

    def __init__(
        self,
        lib: Library,
        weights: ArrayLike | None = None,
        *,
        columns: int = 0,
        forgetting: float = 1.0,
        every: int = 100,
        kappa: float = CAD,
        first: ArrayLike | None = None,
    ) -> None:
        if not 0.0 < forgetting <= 1.0:
            raise IdentificationError(
                f"expected a forgetting factor above 0 and at most 1, got {forgetting}; "
                "1 forgets nothing"
            )
        if every < 1 or not kappa > 0 or columns < 0:
            raise IdentificationError(
                f"expected every ≥ 1, κ > 0 and columns ≥ 0, got {every}, {kappa} and {columns}; "
                "correct them"
            )
        n = lib.n_joints
        self._lib, self._columns = lib, columns
        given = np.ones(n) if weights is None else np.asarray(weights, dtype=float)
        if given.shape != (n,) or not (np.isfinite(given) & (given > 0)).all():
            raise IdentificationError(
                f"expected {n} weights above 0, got {given}; give 1/σ² of every torque sensor"
            )
        self._weights = np.ascontiguousarray(given)
        self._forgetting, self._every, self._kappa = forgetting, every, kappa
        self._prior: Prior = prior_of(lib, None if first is None else np.asarray(first, float))
        self._pi = self._prior.centre
        size = len(lib.base_columns) + n * columns + 1
        self._triangle = np.zeros((size, size))
        self._count, self._rejected, self._fresh = 0.0, 0, 0

    @property
    def statistics(self) -> Statistics:
        """Factor of all samples so far, old ones with their forgetting."""
        lib = self._lib
        return from_triangle(
            self._triangle.copy(), self._count, lib.base_matrix, lib.manifest.model_hash
        )

    def add(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        columns: ArrayLike | None = None,
    ) -> OnlineEstimate | None:
        """Add one sample or several; samples that are not finite are left out and counted.

        Args:
            q: (n,) or (N, n) joint positions [rad, m].
            dq: joint velocities of the same shape [rad/s, m/s].
            ddq: joint accelerations of the same shape [rad/s², m/s²].
            tau: joint torques of the same shape [N·m, N].
            columns: (N, n, k) friction columns; None without friction.

        Returns:
            The latest model if one was due, else None.

        Raises:
            IdentificationError: the shapes do not fit.
        """
        s = self._samples(q, dq, ddq, tau, columns)
        latest, done = None, 0
        while done < len(s):
            taken = s.rows(slice(done, done + self._every - self._fresh))
            self._absorb(taken)
            done += len(taken)
            self._fresh += len(taken)
            if self._fresh >= self._every:
                self._fresh = 0
                latest = self.estimate()
        return latest

    @one_blas_thread
    def estimate(self) -> OnlineEstimate:
        """The most probable consistent model of the samples so far."""
        lib, statistics, gamma = self._lib, self.statistics, 0.0
        if self._count * lib.n_joints >= len(self._triangle):  # an equation more than unknowns
            data, eliminated = reduce(statistics, lib.n_joints)
            size = float(statistics.target @ statistics.target) / self._count
            gamma = self._kappa * max(data.variance, PERFECT * size) / self._count
        if not gamma > 0:
            return self._estimate_of(np.zeros((lib.n_joints, self._columns)), 0.0, 0, False)
        # Compiled Newton steps, to a tolerance at which the start has no effect on the result.
        task = task_of(convex_problem(data, self._prior, gamma), np.ones(1), self._pi)
        (answer,) = CompiledConvex(lib.binding, [task], DECREMENT, MOST_STEPS).run()
        self._pi, steps = answer.points[0], int(answer.steps.sum())
        phi = eliminated.phi(self._pi).reshape(lib.n_joints, self._columns)
        return self._estimate_of(phi, data.variance, steps, answer.converged)

    def gain_of_recording(self, seconds: float, rate_hz: float) -> accuracy.GainOfRecording:
        """Gain of some more seconds of the same motion.

        The information grows in proportion to the samples, N(t + s) / N(t); with ϑ < 1 it is
        bounded by the memory of 1/(1 − ϑ) samples. Residuals count as white.

        Args:
            seconds: further recording time, s.
            rate_hz: rate of the samples, Hz.

        Returns:
            Gain of every link, centre of mass, inertia and base parameter.

        Raises:
            IdentificationError: the time or the rate is not above 0, or there are fewer equations
                than unknowns.
        """
        if not (0 < seconds < np.inf and 0 < rate_hz < np.inf):
            raise IdentificationError(
                f"expected seconds and a rate above 0, got {seconds:g} s and {rate_hz:g} Hz; "
                "correct them"
            )
        if self._count * self._lib.n_joints < len(self._triangle):
            raise IdentificationError(
                f"{self._count:g} samples do not determine {len(self._triangle) - 1} unknowns; add "
                "more before the gain of further ones is computed"
            )
        keep, fresh = self._forgetting, seconds * rate_hz
        ages = fresh if keep == 1.0 else (1 - keep**fresh) / (1 - keep)
        grown = (keep**fresh * self._count + ages) / self._count
        known = accuracy.Knowledge(self._prior, self._pi, self._kappa)
        lib, statistics = self._lib, self.statistics
        unit = max(reduce(statistics, lib.n_joints)[0].variance, np.finfo(float).tiny)
        now, later = (accuracy.expected(lib, statistics, known, u) for u in (unit, unit / grown))
        return accuracy.gained(now.by_name(lib), later.by_name(lib), seconds, "the same motion")

    def advice(self, rate_hz: float, seconds: Sequence[float] = accuracy.SECONDS) -> str:
        """One sentence while recording: values that still improve by 10 %, or "stop".

        The motion is assumed to continue in the same way (`gain_of_recording`).

        Args:
            rate_hz: rate of the samples, Hz.
            seconds: further recording times to evaluate, s.

        Returns:
            The sentence.
        """
        return accuracy.verdict([self.gain_of_recording(each, rate_hz) for each in seconds])

    def _estimate_of(
        self, phi: Array, variance: float, steps: int, converged: bool
    ) -> OnlineEstimate:
        if converged:
            status = f"converged after {steps} Newton steps"
        elif steps:
            status = "not converged; check units and outliers of the torque"
        else:
            status = "too few samples, or no torque yet: this is the first guess"
        if self._rejected:
            status += f"; {self._rejected} samples were not finite and were left out"
        return OnlineEstimate(
            self._pi.copy(), phi, self._count, self._rejected, variance, steps, converged, status
        )

    def _absorb(self, s: Samples) -> None:
        """RᵀR ← ϑᴺ RᵀR + Σ ϑ^(N−1−i) rows_iᵀ W rows_i."""
        values = [a.reshape(len(s), -1) for a in (s.q, s.dq, s.ddq, s.tau, s.columns)]
        good = np.asarray(np.isfinite(np.hstack(values)).all(axis=1))
        self._rejected += int((~good).sum())
        rows = s.rows(good)
        count = len(rows)
        if not count:
            return
        lib, keep = self._lib, self._forgetting
        update = lib.compiled_statistics.update if lib.compiled_statistics else None
        if self._columns == 0 and update is not None:
            for state in zip(rows.q, rows.dq, rows.ddq, rows.tau, strict=True):
                update(self._triangle, keep, *state, self._weights)
        else:
            forgotten = keep ** np.arange(count - 1, -1, -1.0)
            fresh = compress(lib, rows, self._weights, forgotten, threads=1)
            self._triangle = self.statistics.scaled(keep**count).merged(fresh).triangle()
        ages = keep ** np.arange(count)
        self._count = keep**count * self._count + float(ages.sum())

    def _samples(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, tau: ArrayLike, columns: ArrayLike | None
    ) -> Samples:
        n = self._lib.n_joints
        motion = [np.atleast_2d(np.asarray(a, dtype=float)) for a in (q, dq, ddq, tau)]
        count = len(motion[0])
        extra = np.zeros((count, n, 0)) if columns is None else np.asarray(columns, dtype=float)
        extra = extra.reshape(count, n, -1) if extra.size == count * n * self._columns else extra
        if any(a.shape != (count, n) for a in motion) or extra.shape != (count, n, self._columns):
            raise IdentificationError(
                f"expected q, dq, ddq and tau of {n} joints and {self._columns} friction columns, "
                f"got {', '.join(str(a.shape) for a in (*motion, extra))}"
            )
        return Samples(*(np.ascontiguousarray(a) for a in (*motion, extra)))
