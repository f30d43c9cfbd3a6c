"""Observation of a log: external torque with σ, thresholds as functions of the state, contacts.

    threshold_j(t) = z_j √(σ_j² + band_j(t)²) + dry_j(t) + Δ |dτ_j/dt|

σ_j is the noise of r in free motion, band_j the standard deviation of the model's torque by its
posterior at the present state, z_j follows from the rate of false alarms. Without
further logs z_j is that of a Gaussian sequence; `runtime.monitoring.calibration` takes it from free
motion. dry_j is twice the dry
friction of the joint at rest and for 0.1 s after a reversal, where it may act in either direction,
else 0; of friction with a memory (dahl) it is F exp(−travel / z_c), because its first state is
unknown. Δ |dτ_j/dt| covers torque and position that lie up to a sampling step Δ apart.
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.monitoring.contacts import Contact, contacts_of
from runtime.monitoring.false_alarms import AlarmRate, levels, rate_by_stretches
from runtime.monitoring.model import CHUNK, NO_SIGNALS, MonitoredModel
from runtime.monitoring.model import Signals as FurtherSignals
from runtime.monitoring.noise import (
    REVERSAL_S,
    HeldOutResidual,
    ObserverNoise,
    near,
    noise_of_observer,
)
from runtime.monitoring.observer import (
    ObserverSettings,
    averaged,
    external_torque,
    observer_settings,
    window_mean,
)
from runtime.recording import Preparation, Recording
from runtime.recording.friction import motion_of
from runtime.recording.preprocessing import differentiate, on_grid, segments

WITHIN_S = 0.025
"""Time in which r shows 95 % of a step unless it is stated [s]."""
WINDOWS = (0.0, 1 / 6, 1 / 3, 2 / 3)
"""Candidates of the averaging window, as shares of that time."""
EXCERPT_S = 60.0
"""Length of a log from which the observer is chosen [s]."""
RATE_OFF = 0.01
"""Relative difference of rates up to which two logs count as equally fast."""
SLOPE_STEPS = 10
"""Samples over which the slope of the torque is taken, at least."""
BAND_HZ = 100.0
"""Rate at which the model's band is evaluated; it changes with the motion [Hz]."""


@dataclass(frozen=True, slots=True, eq=False)
class Detector:
    """Observer with thresholds.

    Attributes:
        model: identified model.
        settings: of the observer.
        within_s: time in which r shows 95 % of a step [s].
        rate: stated rate of false alarms.
        noise: of r in free motion.
        levels: z, (n,).
        root: root of the covariance of [β; φ], (p, columns); None where it is not known.
    """

    model: MonitoredModel
    settings: ObserverSettings
    within_s: float
    rate: AlarmRate
    noise: ObserverNoise
    levels: Array
    root: Array | None

    @property
    def thresholds(self) -> Array:
        """Thresholds without the model's band, (n,) [N·m, N]."""
        return self.noise.thresholds(self.levels)

    @property
    def expected_rate(self) -> float:
        """Rate of false alarms where the variance of r differs from stretch to stretch [1/s]."""
        noise = self.noise
        z = self.thresholds / np.maximum(noise.sigma, 1e-300)
        return rate_by_stretches(z, noise.correlation, self.settings.rate_hz, noise.ratios)


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """External torque of a log and its contacts.

    Attributes:
        t: (N,) [s].
        r: (N, n) external torque, NaN where unknown [N·m, N].
        sigma: (N, n) standard deviation of r in free motion [N·m, N].
        threshold: (N, n) [N·m, N].
        contacts: in the order of time.
        seconds: duration for which r is known [s].
    """

    t: Array
    r: Array
    sigma: Array
    threshold: Array
    contacts: tuple[Contact, ...]
    seconds: float


def candidates(rate_hz: float, within_s: float) -> tuple[ObserverSettings, ...]:
    """Observers that show 95 % of a step in a stated time, by window and source of the speed."""
    if not within_s * rate_hz >= 3 - 1e-9:
        raise IdentificationError(
            f"expected three samples or more in which a contact is shown, got {within_s:g} s at "
            f"{rate_hz:g} Hz; raise --within"
        )
    steps = sorted({int(share * within_s * rate_hz) for share in WINDOWS})
    pairs = [(each, "measured") for each in steps] + [(each, "position") for each in steps if each]
    return tuple(observer_settings(rate_hz, within_s, each, source) for each, source in pairs)


def detector_for(
    lib: Library,
    model: MonitoredModel,
    recording: Recording,
    held_out: HeldOutResidual,
    rate: AlarmRate,
    within_s: float = WITHIN_S,
    root: Array | None = None,
) -> Detector:
    """The observer with the smallest thresholds on a log."""
    count = int(np.searchsorted(recording.t, recording.t[0] + EXCERPT_S)) or 1
    part = recording.take(slice(0, count), "Took an excerpt.")
    signals = part.t, part.q, part.required("dq"), part.required("tau"), _further(part, model)
    choices = []
    for settings in candidates(part.rate_hz, within_s):
        r = external_torque(lib, model, settings, *signals)
        noise = noise_of_observer(settings, held_out, part.t, r)
        z = levels(rate.per_second, noise.correlation, settings.rate_hz)
        choices.append(Detector(model, settings, within_s, rate, noise, z, root))
    # Product of the thresholds of all joints, whatever their units.
    return min(choices, key=lambda each: np.sum(np.log(np.maximum(each.thresholds, 1e-300))))


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """External torque of a log with the terms of its thresholds, before a rate is stated.

    Attributes:
        t: (N,) [s].
        r: (N, n) external torque, NaN where unknown [N·m, N].
        band: (N, n) standard deviation of the model's torque [N·m, N].
        sigma: (N, n) standard deviation of r in free motion, band included [N·m, N].
        extra: (N, n) dry friction and timing in the thresholds [N·m, N].
    """

    t: Array
    r: Array
    band: Array
    sigma: Array
    extra: Array

    @property
    def normalised(self) -> Array:
        """(|r| − extra)/σ, (N, n): the level z at which a sample is an alarm; NaN where unknown."""
        return np.asarray((np.abs(self.r) - self.extra) / np.maximum(self.sigma, 1e-300))


def signals_of(lib: Library, detector: Detector, recording: Recording) -> Signals:
    """External torque of a log and the terms of its thresholds."""
    rate = detector.settings.rate_hz
    if abs(recording.rate_hz - rate) > RATE_OFF * rate:
        raise IdentificationError(
            f"expected a log at {rate:g} Hz, for which the observer was made, got "
            f"{recording.rate_hz:g} Hz; give logs of one rate"
        )
    t, q = recording.t, recording.q
    dq, tau = recording.required("dq"), recording.required("tau")
    model, further = detector.model, _further(recording, detector.model)
    r = external_torque(lib, model, detector.settings, t, q, dq, tau, further)
    state = t, q, dq, tau, further
    band, extra = state_terms(lib, model, detector.settings, detector.root, *state)
    return Signals(t, r, band, np.sqrt(detector.noise.sigma**2 + band**2), extra)


def observe(lib: Library, detector: Detector, recording: Recording) -> Observation:
    """External torque and contacts of a log."""
    return observation_of(lib, detector, signals_of(lib, detector, recording))


def observation_of(lib: Library, detector: Detector, seen: Signals) -> Observation:
    """Contacts by the thresholds of a detector."""
    threshold = detector.noise.thresholds(detector.levels, seen.band) + seen.extra
    contacts = contacts_of(
        seen.t, seen.r, seen.sigma, threshold, lib.joint_names, detector.within_s
    )
    seconds = float(np.isfinite(seen.r[:, 0]).sum() / detector.settings.rate_hz)
    return Observation(seen.t, seen.r, seen.sigma, threshold, contacts, seconds)


def prepared_for(recording: Recording, model: MonitoredModel) -> Recording:
    """The log on a uniform grid with dq, its torque without delay, unfiltered."""
    steps = recording.preparation
    if steps == Preparation():
        steps = model.preparation
    if steps.max_gap_s is None:
        steps = replace(steps, max_gap_s=3.0 / recording.rate_hz)
    data = on_grid(recording, steps)
    return differentiate(data) if data.dq is None else data


def _further(recording: Recording, model: MonitoredModel) -> FurtherSignals:
    """The signals of a log that the columns of a model need beside the motion."""
    return motion_of(recording, model.terms.columns, None).signals


def state_terms(
    lib: Library,
    model: MonitoredModel,
    s: ObserverSettings,
    root: Array | None,
    t: Array,
    q: Array,
    dq: Array,
    tau: Array,
    signals: FurtherSignals = NO_SIGNALS,
) -> tuple[Array, Array]:
    """Band of the model, and dry friction with timing.

    root (p, columns) [β; φ], t (N,) [s], q (N, n) [rad, m], dq (N, n) [rad/s, m/s], tau (N, n)
    [N·m, N], signals that the columns need → (N, n) [N·m, N].
    """
    band, extra = np.zeros_like(q), np.zeros_like(q)
    for part in segments(t):
        if part.stop - part.start <= s.steps + 1:
            continue
        position, speed, torque = averaged(s, q[part], dq[part], tau[part])
        if root is not None:
            further = {key: window_mean(s, values[part]) for key, values in signals.items()}
            band[part][s.steps :] = _band(lib, model, s, root, position, speed, further)
        slow = near(t[part][s.steps :], model.is_slow(speed), 0.0, REVERSAL_S)
        extra[part][s.steps :] = slow * (2 * model.dry_friction)
        travel = np.abs(np.diff(position, axis=0, prepend=position[:1])).cumsum(axis=0)
        extra[part][s.steps :] += model.unknown_state(travel)
        lag = max(s.steps, SLOPE_STEPS)
        extra[part][s.steps + lag :] += np.abs(torque[lag:] - torque[:-lag]) / lag
    return band, extra


def _band(
    lib: Library,
    model: MonitoredModel,
    s: ObserverSettings,
    root: Array,
    q: Array,
    dq: Array,
    signals: FurtherSignals,
) -> Array:
    """σ of the model's torque, ‖(dP/dt − S) L‖ by differences over 1/BAND_HZ, (N, n)."""
    stride = max(round(s.rate_hz / BAND_HZ), 1)
    index = np.arange(0, len(q), stride)
    if len(index) < 2:
        return np.zeros_like(q)
    values = np.empty((len(index) - 1, q.shape[1]))
    size = max(CHUNK // 8, 2)
    for start in range(0, len(index) - 1, size - 1):
        taken = index[start : start + size]
        further = {key: values[taken] for key, values in signals.items()}
        over_p, over_s = model.rows(lib, q[taken], dq[taken], further)
        change = np.diff(over_p, axis=0) * (s.rate_hz / stride)
        rows = change - (over_s[1:] + over_s[:-1]) / 2
        values[start : start + len(taken) - 1] = np.linalg.norm(rows @ root, axis=2)
    held = np.minimum(np.arange(len(q)) // stride, len(values) - 1)
    return np.asarray(values[held])
