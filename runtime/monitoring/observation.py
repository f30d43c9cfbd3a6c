"""Observation of a log: external torque with σ, thresholds as functions of the state, contacts.

    threshold_j(t) = z_j √(σ_j² + band_j(t)²) + w (dry_j(t) + Δ |dτ_j/dt|) + rest_j(t)

σ_j is the noise of r in free motion, band_j the standard deviation of the model's torque by its
posterior at the present state and of what is learnt of the session, and
z_j follows from the rate of false alarms. Without further logs w = 1 and z_j is that of a Gaussian
sequence; `runtime.monitoring.calibration` takes both from free motion. dry_j is twice the dry
friction of the joint at rest and for 0.1 s after a reversal, where it may act in either direction,
else 0; of friction with a memory (dahl) it is F exp(−travel / z_c), because its first state is
unknown. Δ |dτ_j/dt| covers torque and position that lie up to a sampling step Δ apart. rest_j is
`REST` times the limit of the torque while a joint rests whose dry friction the model lacks.

A stiff arm that is stopped shows its contact in the torque of the motor first, while the rate of
the momentum, by differences of a measured speed, has more noise than signal. In joints where it has
the smaller threshold a calibrated observer takes that rate over `DIRECT_S` and the torque as it was
measured, the direct torque, in place of r.

Offsets of the sensors change from day to day, and friction with the warmth of the gears:

    r_k = f_kᵀ θ + e_k,   f = (1, viscous friction, dry friction) of the model,   e ~ N(0, σ²)

with θ = (bias [N·m, N], relative changes of both) per joint and k blocks of 0.1 s. A Kalman filter
follows θ: the bias is unknown at first and forgotten in `BIAS_S`, the friction differs by `VISCOUS`
and `DRY` and drifts as much in `WARMTH_S`. Its prediction is subtracted from r, and its variance
fᵀ P f is added to that of r in the thresholds. A block far from the prediction may be a contact and
is left out. What stays for `HOLD_BLOCKS`, or for as long as θ was followed before, is no contact
but a bias, and θ starts again. It starts in `START_BLOCKS` blocks, of which the last one sets the
bias: no contact is found in them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array, Library, Mask
from runtime.monitoring import noise as noises
from runtime.monitoring import observer
from runtime.monitoring.model import CHUNK, SLOW, MonitoredModel
from runtime.recording import Preparation, Recording
from runtime.recording.friction.model import DAY, LARGE_DAY
from runtime.recording.preprocessing.segments import differentiate, on_grid
from runtime.recording.rest_speeds import rest_speeds
from runtime.recording.settings import JointMotion

BLOCK_S = 0.1  # length of a block [s]
BIAS_S = 5.0  # time in which a bias is followed [s]
VISCOUS, DRY = LARGE_DAY, DAY
"""Relative standard deviation of viscous and dry friction between days of a healthy robot."""
WARMTH_S = 600.0  # time in which friction drifts by as much [s]
UNKNOWN_BIAS = 30.0  # standard deviation of the first bias in units of σ
OUTLIER = 3.5  # standard deviations from which a block may be a contact
HOLD_BLOCKS = 100  # largest number of blocks that are left out in a row: 10 s
START_BLOCKS = 3


def first_covariance(sigma: Array) -> Array:
    """P of θ before the first block, from σ (n,): (n, 3)."""
    ones = np.ones_like(sigma)
    return np.stack([(UNKNOWN_BIAS * sigma) ** 2, VISCOUS**2 * ones, DRY**2 * ones], axis=1)


def drift_of_block(sigma: Array) -> Array:
    """Variance that θ gains in a block, from σ (n,): (n, 3)."""
    ones = np.ones_like(sigma)
    share = BLOCK_S / WARMTH_S
    bias = (sigma * BLOCK_S / BIAS_S) ** 2
    return np.stack([bias, share * VISCOUS**2 * ones, share * DRY**2 * ones], axis=1)


def block_steps(rate_hz: float) -> int:
    """Samples of a block."""
    return max(round(BLOCK_S * rate_hz), 1)


def usual_torque(r: Array, features: Array, sigma: Array, rate_hz: float) -> tuple[Array, Array]:
    """Prediction of r (N, n), NaN where unknown, from earlier blocks, and its variance."""
    usual, variance = np.zeros_like(r), np.zeros_like(r)
    known = np.flatnonzero(np.isfinite(r).all(axis=1))
    size, n = block_steps(rate_hz), r.shape[1]
    start, drift = (
        each[:, :, None] * np.eye(3) for each in (first_covariance(sigma), drift_of_block(sigma))
    )
    theta, p = np.zeros((n, 3)), start.copy()
    count, left_out = np.zeros((2, n), dtype=int)
    noise = np.maximum(sigma**2, 1e-300)
    for begin in range(0, len(known), size):
        block = known[begin : begin + size]
        f = features[block]
        usual[block] = (f * theta).sum(axis=2)
        variance[block] = np.einsum("tji,jil,tjl->tj", f, p, f)
        if len(block) < size:
            break
        mean, seen = f.mean(axis=0), r[block].mean(axis=0)
        gain = np.einsum("jil,jl->ji", p, mean)
        spread = (gain * mean).sum(axis=1) + noise
        error = seen - (mean * theta).sum(axis=1)
        is_far = (error**2 > OUTLIER**2 * spread) & (count >= START_BLOCKS)
        taken = (~is_far / spread)[:, None] * gain
        theta = theta + taken * error[:, None]
        p = p - taken[:, :, None] * gain[:, None, :] + drift
        left_out = np.where(is_far, left_out + 1, 0)
        count = count + ~is_far
        again = left_out > np.minimum(count, HOLD_BLOCKS)
        count[again] = left_out[again] = 0
        at_start = count < START_BLOCKS
        p[at_start] = start[at_start]
    return usual, variance


WITHIN_S = 0.025
"""Time in which r shows 95 % of a step unless it is stated, or three samples if these are longer
[s]."""
LEAST_SAMPLES = 3  # samples in which a step can be shown
SLOWEST = 0.5
"""Speed below which thresholds are those of rest, over that below which a joint rests in a log."""
REST = 0.02
"""Dry friction of a resting joint that the model does not contain, as a share of its limit."""
DIRECT_S = 0.1  # time over which the direct torque takes the rate of the momentum [s]
WINDOWS = (0.0, 1 / 6, 1 / 3, 2 / 3)  # candidates of the averaging window, as shares of that time
EXCERPT_S = 60.0  # length of a log from which the observer is chosen [s]
RATE_OFF = 0.01  # relative difference of rates up to which two logs count as equally fast
SLOPE_STEPS = 10  # samples over which the slope of the torque is taken, at least
BAND_HZ = 20.0
"""Rate at which the model's band is evaluated: it changes with the motion, and differences of a
noisy speed over shorter times would enlarge it [Hz]."""


@dataclass(frozen=True, slots=True, eq=False)
class Detector:
    """Observer with thresholds."""

    model: MonitoredModel  # identified model
    settings: observer.ObserverSettings  # of the observer
    within_s: float  # time in which r shows 95 % of a step [s]
    rate: noises.AlarmRate  # stated rate of false alarms
    noise: noises.ObserverNoise  # of r in free motion
    levels: Array  # z, (n,)
    root: Array | None  # root of the covariance of [β; φ], (p, columns); None where it is not known
    share: Array | float = 1.0  # w of dry friction and timing in the thresholds, (n,)
    is_direct: Mask | bool = False  # whether r is the direct torque, (n,)

    @property
    def thresholds(self) -> Array:
        """Thresholds without the model's band, (n,) [N·m, N]."""
        return self.noise.thresholds(self.levels)

    @property
    def expected_rate(self) -> float:
        """Rate of false alarms where the variance of r differs from stretch to stretch [1/s]."""
        noise = self.noise
        z = self.thresholds / np.maximum(noise.sigma, 1e-300)
        return noises.rate_by_stretches(z, noise.correlation, self.settings.rate_hz, noise.ratios)


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """External torque of a log and its contacts."""

    t: Array  # (N,) [s]
    r: Array  # (N, n) external torque, NaN where unknown [N·m, N]
    sigma: Array  # (N, n) standard deviation of r in free motion [N·m, N]
    threshold: Array  # (N, n) [N·m, N]
    contacts: tuple[observer.Contact, ...]  # in the order of time
    seconds: float  # duration for which r is known [s]


def candidates(rate_hz: float, within_s: float) -> tuple[observer.ObserverSettings, ...]:
    """Observers that show 95 % of a step in a stated time, by window and source of the speed."""
    if not within_s * rate_hz >= LEAST_SAMPLES * (1 - RATE_OFF):
        raise IdentificationError(
            f"expected three samples or more in which a contact is shown, got {within_s:g} s at "
            f"{rate_hz:g} Hz; raise the setting within"
        )
    steps = sorted({int(share * within_s * rate_hz) for share in WINDOWS})
    pairs = [(each, "measured") for each in steps] + [(each, "position") for each in steps if each]
    return tuple(observer.observer_settings(rate_hz, within_s, *pair) for pair in pairs)


def detector_for(
    lib: Library,
    model: MonitoredModel,
    recording: Recording,
    held_out: noises.HeldOutResidual,
    rate: noises.AlarmRate,
    within_s: float | None = None,
    root: Array | None = None,
) -> Detector:
    """The observer with the smallest thresholds on a log."""
    if within_s is None:
        within_s = max(WITHIN_S, LEAST_SAMPLES / recording.rate_hz)
    count = int(np.searchsorted(recording.t, recording.t[0] + EXCERPT_S)) or 1
    part = recording.take(slice(0, count), "Took an excerpt.")
    choices = []
    for settings in candidates(part.rate_hz, within_s):
        (r,) = observer.external_torques(lib, model, settings, part)
        noise = noises.noise_of_observer(settings, held_out, part.t, r)
        z = noises.levels(rate.per_second, noise.correlation, settings.rate_hz)
        choices.append(Detector(model, settings, within_s, rate, noise, z, root))
    # Product of the thresholds of all joints, whatever their units.
    return min(choices, key=lambda each: np.sum(np.log(np.maximum(each.thresholds, 1e-300))))


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """External torque of a log with the terms of its thresholds, before a rate is stated."""

    t: Array  # (N,) [s]
    # (N, n) external torque without what is usual in this session, NaN where unknown [N·m, N]
    r: Array
    sigma: Array  # (N, n) standard deviation of r in free motion, band included [N·m, N]
    model_band: Array  # (N, n) standard deviation of the model's torque [N·m, N]
    band: Array  # (N, n) the same with that of what is usual [N·m, N]
    extra: Array  # (N, n) dry friction and timing in the thresholds [N·m, N]
    rest: Array  # (N, n) unknown dry friction of resting joints [N·m, N]

    def normalised(self, share: Array | float) -> Array:
        """Level z at which a sample is an alarm, (N, n); NaN where r is unknown."""
        beyond = np.abs(self.r) - share * self.extra - self.rest
        return np.asarray(beyond / np.maximum(self.sigma, 1e-300))


def signals_of(
    lib: Library, detector: Detector, log: Recording, torques: Sequence[Array] | None = None
) -> Signals:
    """External torque of a log and the terms of its thresholds, by what `both_torques` returned."""
    s, model = detector.settings, detector.model
    if abs(log.rate_hz - s.rate_hz) > RATE_OFF * s.rate_hz:
        raise IdentificationError(
            f"expected a log at {s.rate_hz:g} Hz, for which the observer was made, got "
            f"{log.rate_hz:g} Hz; give logs of one rate"
        )
    first, direct, features = torques or both_torques(lib, model, s, log)
    r = np.where(detector.is_direct, direct, first)
    # What is usual is known from where all joints are, and the direct torque is later.
    r[~np.isfinite(r).all(axis=1)] = np.nan
    band, extra, rest = (np.zeros_like(log.q) for _ in range(3))
    unknown, slowest = unknown_dry_friction(lib, model), slow_speeds(lib, model)
    for rows, motion, torque in observer.windows(lib, model, s, log):
        t, position, speed = log.t[rows], np.asarray(motion.q), motion.dq
        if detector.root is not None:
            band[rows] = _band(lib, detector, detector.root, motion)
        if unknown.any():
            rest[rows] = noises.near(t, np.abs(speed) < slowest, 0.0, noises.REVERSAL_S) * unknown
        slow = noises.near(t, model.is_slow(speed), 0.0, noises.REVERSAL_S)
        travel = np.abs(np.diff(position, axis=0, prepend=position[:1])).cumsum(axis=0)
        extra[rows] = slow * (2 * model.dry_friction) + model.unknown_state(travel)
        lag = max(s.steps, SLOPE_STEPS)
        extra[rows][lag:] += np.abs(torque[lag:] - torque[:-lag]) / lag
    sigma = detector.noise.sigma
    usual, variance = usual_torque(r, features, sigma, s.rate_hz)
    known = np.sqrt(band**2 + variance)
    return Signals(log.t, r - usual, np.sqrt(sigma**2 + known**2), band, known, extra, rest)


def both_torques(
    lib: Library, model: MonitoredModel, s: observer.ObserverSettings, recording: Recording
) -> tuple[Array, Array, Array]:
    """r, the direct torque with the rate of the momentum over `DIRECT_S`, and the features.

    The features (N, n, 3) are what differs between sessions, at the means of the window.
    """
    r, direct = observer.external_torques(lib, model, s, recording, (1, direct_steps(s.rate_hz)))
    features = np.zeros((*r.shape, 3))
    for rows, motion, _ in observer.windows(lib, model, s, recording):
        features[rows] = model.session_features(motion)
    return r, np.where(np.isfinite(r), direct, np.nan), features


def unknown_dry_friction(lib: Library, model: MonitoredModel) -> Array:
    """Dry friction of resting joints of which the model contains none, (n,) [N·m, N]."""
    is_known = (model.dry_friction > 0) | (model.lasting_friction > 0)
    limits = lib.limits()["effort"]
    return np.where(is_known | ~np.isfinite(limits), 0.0, REST * limits)


def slow_speeds(lib: Library, model: MonitoredModel) -> Array:
    """Speeds of unknown direction of dry friction, (n,); of rest where it is not known."""
    is_known = unknown_dry_friction(lib, model) == 0
    return np.where(is_known, SLOW * model.terms.coulomb_speed, SLOWEST * rest_speeds(lib))


def direct_steps(rate_hz: float) -> int:
    """Steps over which the direct torque takes the rate of the momentum."""
    return max(round(DIRECT_S * rate_hz), 1)


def observe(lib: Library, detector: Detector, recording: Recording) -> Observation:
    """External torque and contacts of a log."""
    return observation_of(lib, detector, signals_of(lib, detector, recording))


def observation_of(lib: Library, detector: Detector, seen: Signals) -> Observation:
    """Contacts by the thresholds of a detector."""
    threshold = detector.noise.thresholds(detector.levels, seen.band)
    threshold += detector.share * seen.extra + seen.rest
    contacts = observer.contacts_of(
        seen.t, seen.r, seen.sigma, threshold, lib.joint_names, detector.within_s
    )
    seconds = float(np.isfinite(seen.r).any(axis=1).sum() / detector.settings.rate_hz)
    return Observation(seen.t, seen.r, seen.sigma, threshold, contacts, seconds)


def prepared_for(
    recording: Recording, model: MonitoredModel, rate_hz: float | None = None
) -> Recording:
    """The log on a uniform grid, of a stated rate if any, unfiltered; τ without delay."""
    steps = recording.preparation
    if steps == Preparation():
        steps = model.preparation.at_rate(recording.rate_hz)
    if steps.max_gap_s is None:
        steps = replace(steps, max_gap_s=3.0 / recording.rate_hz)
    if rate_hz is not None:
        usual_hz = steps.grid_hz or recording.rate_hz
        if abs(usual_hz - rate_hz) > RATE_OFF * rate_hz:
            steps = replace(steps, grid_hz=rate_hz)
    data = on_grid(recording, steps)
    return differentiate(data) if data.dq is None else data


def _band(lib: Library, detector: Detector, root: Array, motion: JointMotion) -> Array:
    """σ of the model's torque, ‖(dP/dt − S) L‖ by differences over 1/BAND_HZ, (N, n)."""
    rate_hz, q, dq = detector.settings.rate_hz, np.asarray(motion.q), motion.dq
    stride = max(round(rate_hz / BAND_HZ), 1)
    index = np.arange(0, len(q), stride)
    if len(index) < 2:
        return np.zeros_like(q)
    values = np.empty((len(index) - 1, q.shape[1]))
    size = max(CHUNK // 8, 2)
    for start in range(0, len(index) - 1, size - 1):
        taken = index[start : start + size]
        signals = {key: x[taken] for key, x in motion.signals.items()}
        some = JointMotion(dq[taken], q[taken], lib=lib, signals=signals)
        over_p, over_s = detector.model.rows(lib, some)
        rows = np.diff(over_p, axis=0) * (rate_hz / stride) - (over_s[1:] + over_s[:-1]) / 2
        values[start : start + len(taken) - 1] = np.linalg.norm(rows @ root, axis=2)
    return np.asarray(values[np.minimum(np.arange(len(q)) // stride, len(values) - 1)])
