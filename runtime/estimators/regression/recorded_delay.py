"""Delay between the torque and the motion of a recording, from the profile of the loss.

    τ(t + δ) = Y π0 + F φ + e      links of the URDF, or free base parameters Y_b β instead of Y π0

A commanded torque is fitted with the links of the URDF: friction and rotor inertia dominate it, and
free links would imitate a delay (kp d dq like viscous friction, kd d ddq like inertia).

The profile is that of linear least squares at every delay:

    τ(t + δ) = W x + e,   L(δ) = Σ_j N_eff/2 · ln s_j²(δ),   s_j² the residual variance of joint j

δ is the time by which the log stamps τ late (`Preparation.torque_delay_s`); a commanded torque that
acts d later has δ = −d. N_eff is the effective sample size of the residuals. The interval holds all
δ with L(δ) − L(δ̂) ≤ 1.92, half the 95 % quantile of χ² with one degree of freedom.
Source: profile likelihood of Gaussian noise with unknown variances (Murphy & van der Vaart 2000).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import NORMAL_95, samples_of
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.segments import interpolate
from runtime.recording.recipes.recipe import COMMANDED

PASSES = 2
"""Passes in which the weights of the joints follow their residuals at the best delay."""
FLAT_SHARE = 0.5
"""Width of the 99.9 % interval over that of the range from which on the profile is flat."""
ROWS = 900
"""Number of rows of the profile: some hundred of them are independent."""
FEWEST_ROWS = 100
"""Rows below which no delay is estimated."""
STEP_S = 0.002
"""Step of the delays that are tried [s]; a parabola resolves fractions of it."""
LATEST_S, EARLIEST_S = 0.15, 0.03
"""Range of delays of a commanded torque behind its stamp, and before it [s]; the first is that of a
measured torque on both sides."""
CUTOFF_HZ, SHARE = 10.0, 0.2
"""Cut-off where the preparation has no filter [Hz], and the same over the rate of a slow log."""


@dataclass(frozen=True, slots=True, eq=False)
class DelayProfile:
    """Loss over the delay."""

    delays: Array  # δ that were tried, (M,) [s], ascending
    loss: Array  # L(δ) − min L, (M,); 1.92 at the ends of the interval
    best: float  # δ̂, least point of a parabola through the three lowest losses [s]
    interval: tuple[float, float]  # first and last δ within the interval [s]
    variance: Array  # residual variance of every joint at every delay, (M, n) [(N·m)²]

    @property
    def is_flat(self) -> bool:
        """Whether the data do not determine a delay within the range."""
        # A delay that is determined has its 99.9 % interval within the delays tried.
        low, high = _interval(self.delays, self.loss, chdtri(1, 0.001) / 2)
        is_cut = low <= self.delays[0] or high >= self.delays[-1]
        return bool(is_cut or high - low > FLAT_SHARE * (self.delays[-1] - self.delays[0]))

    @property
    def sigma(self) -> float:
        """Standard deviation whose 95 % interval is as wide as that of δ [s]."""
        return (self.interval[1] - self.interval[0]) / (2 * NORMAL_95)

    @property
    def gain(self) -> float:
        """Share of the squared residual that δ̂ removes, geometric mean of the joints."""
        zero, best = int(np.argmin(np.abs(self.delays))), int(np.argmin(self.loss))
        used = (self.variance[zero] > 0) & (self.variance[best] > 0)
        ratio = np.log(self.variance[best, used] / self.variance[zero, used])
        return float(1.0 - np.exp(ratio.mean())) if used.any() else 0.0


@dataclass(frozen=True, slots=True)
class RecordedDelay:
    """Delay of a recording."""

    profile: DelayProfile  # loss over δ = `Preparation.torque_delay_s`
    # of the delay d in δ = sign · d: −1 for a commanded torque, which acts later than it is
    # stamped, 1 for a measured one, which is stamped later than it acts
    sign: float

    @property
    def delay_s(self) -> float:
        """d̂ [s]."""
        return self.sign * self.profile.best

    @property
    def interval_s(self) -> tuple[float, float]:
        """95 % interval of d [s]."""
        first, last = sorted(self.sign * end for end in self.profile.interval)
        return first, last


def sign_of_delay(recording: Recording) -> float:
    """Sign of the delay d in `Preparation.torque_delay_s` = sign · d."""
    return -1.0 if recording.torque_source == COMMANDED else 1.0


def recorded_delay(
    recording: Recording, lib: Library, preparation: Preparation, terms: Friction
) -> RecordedDelay:
    """Profile of the loss over the delay of a recording."""
    whole = prepare(
        recording.replace(columns=None, column_names=(), motors=None),
        filtered(recording, preparation),
        terms,
        lib=lib,
    )
    commanded = recording.torque_source == COMMANDED
    first, last = (-LATEST_S, EARLIEST_S) if commanded else (-LATEST_S, LATEST_S)
    t = whole.t
    rows = np.flatnonzero((t + first >= t[0]) & (t + last <= t[-1]))
    rows = rows[:: max(1, len(rows) // ROWS)]
    if len(rows) < FEWEST_ROWS:
        raise IdentificationError(
            f"expected {FEWEST_ROWS} rows or more to estimate a delay, got {len(rows)}; record for "
            "longer, or give the delay in the recipe (torque_delay_s under [preparation])"
        )
    samples = samples_of(whole, lib).rows(rows)
    columns = samples.friction_rows()
    model = samples.rigid(lib, lib.pi0) if commanded else np.zeros_like(samples.tau)
    if not commanded:
        columns = np.concatenate([samples.base_rows(lib), columns], axis=2)
    tau = whole.required("tau")

    def torque(delay: float) -> Array:
        return interpolate(t[rows] + delay, t, tau) - model

    # A coarse search of the whole range finds the valley, whose width is a quarter of the period.
    width = 0.25 / (preparation.cutoff_hz or CUTOFF_HZ)
    width = STEP_S * float(np.ceil(max(width, 4 / recording.rate_hz) / STEP_S))
    if not commanded:
        tried = np.linspace(first, last, round(2 * (last - first) / width) + 1)
        coarse = delay_profile(columns, torque, tried)
        first, last = max(first, coarse.best - width), min(last, coarse.best + width)
    steps = range(round(first / STEP_S), round(last / STEP_S) + 1)
    delays = np.array([STEP_S * k for k in steps])
    return RecordedDelay(delay_profile(columns, torque, delays), sign_of_delay(recording))


def filtered(recording: Recording, preparation: Preparation) -> Preparation:
    """The preparation without delay, decimation and removal of rest, with a low-pass."""
    usual = replace(
        preparation, rate_hz=None, rest_speed=None, torque_delay_s=None, regressor="acceleration"
    )
    if usual.filter != "none":
        return usual
    cutoff = min(CUTOFF_HZ, SHARE * recording.rate_hz)
    grid = usual.max_gap_s or float(f"{4.0 / recording.rate_hz:.3g}")
    trim = float(f"{min(1.0 / cutoff, 0.05 * recording.duration):.3g}")
    return replace(usual, filter="butterworth", cutoff_hz=cutoff, max_gap_s=grid, trim_s=trim)


def delay_profile(rows: Array, torque: Callable[[float], Array], delays: Array) -> DelayProfile:
    """Profile of the loss over the delay.

    rows (N, n, p), torque (N, n) [s], delays (M,) [s].
    """
    count, n, p = rows.shape
    shifted = [torque(float(delay)) for delay in delays]
    start = shifted[int(np.argmin(np.abs(delays)))]
    scale = 1.0 / np.maximum(start.std(axis=0), 1e-12 * float(start.std()) + 1e-300)
    rests = shifted
    best = 0
    for _ in range(PASSES):
        # Weighted orthonormal basis of the columns: one product per delay.
        weighted = rows * scale[:, None]
        left = weighted.reshape(count * n, p) @ posterior_of(weighted).root
        rests = []
        for tau in shifted:
            target = (tau * scale).ravel()
            rests.append(((target - left @ (left.T @ target)).reshape(count, n)) / scale)
        variance = np.array([np.mean(rest**2, axis=0) for rest in rests])
        floor = 1e-12 * float(np.mean(start**2)) + 1e-300
        logs = np.log(np.maximum(variance, floor))
        best = int(np.argmin(logs.sum(axis=1)))
        scale = 1.0 / np.sqrt(np.maximum(variance[best], floor))
    inflation = coloured_noise_of_rows(rows * scale[:, None], rests[best] * scale).inflation
    loss = logs.sum(axis=1) * count / inflation / 2
    loss = loss - loss.min()
    middle = _vertex(delays, loss, best)
    return DelayProfile(
        delays, loss, middle, _interval(delays, loss, chdtri(1, 0.05) / 2), variance
    )


def _vertex(x: Array, y: Array, k: int) -> float:
    """Least point of the parabola through the lowest value and its neighbours."""
    if not 0 < k < len(x) - 1:
        return float(x[k])
    low, mid, high = y[k - 1 : k + 2]
    curve = low - 2 * mid + high
    return (
        float(x[k] - (x[k + 1] - x[k]) * (high - low) / (2 * curve)) if curve > 0 else float(x[k])
    )


def _interval(x: Array, y: Array, limit: float) -> tuple[float, float]:
    """Outermost crossings of a limit; √y of a parabola is linear."""
    root, level = np.sqrt(y), np.sqrt(limit)
    inside = np.flatnonzero(y <= limit)
    ends = []
    for i, j in ((int(inside[0]), int(inside[0]) - 1), (int(inside[-1]), int(inside[-1]) + 1)):
        if not 0 <= j < len(x):
            ends.append(float(x[i]))
            continue
        share = (level - root[i]) / (root[j] - root[i])
        ends.append(float(x[i] + share * (x[j] - x[i])))
    return ends[0], ends[1]
