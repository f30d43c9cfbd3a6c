"""Noise of r in free motion: model and friction below a frequency, sensors above it.

    σ² = ∫_0^{f_s} S_e(f) |H(f)|² df + var(r above f_s)

S_e is the spectrum of the residual that `identify` has kept from its test part, which the model
has not seen, and H the observer. f_s is 10 Hz, or below the filter of that log; above it the
variance of r itself counts, in short blocks of the observed log, without those in which it is far
above the median: these hold contacts. Both variances differ from stretch to stretch, with the arm's
posture and the friction that no column describes; `ratios` are for the alarms that this adds.
Reversals of a joint are left out of S_e, because thresholds
add its dry friction there, and so is the beginning of a motion, where friction with a memory has an
unknown state.

Thresholds of correlated noise for a stated rate of false alarms.

A stationary Gaussian sequence of variance σ² with the correlation ρ of neighbours crosses u = z σ
upwards at

    ν(z) = (1/Δ) ∫_{−∞}^{z} φ(x) Q((z − ρ x)/√(1 − ρ²)) dx,

whose limit for Δ → 0 is Rice's formula. z solves 2 n ν(z) = rate for both signs of n joints.
Source: Rice 1945; Leadbetter, Lindgren & Rootzén 1983, Ch. 7.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.fft import dct, idct
from scipy.special import ndtr

from runtime.common.texts import number_of
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.regression.samples import Samples
from runtime.identification.saved_result import read_predictions
from runtime.library import Array, Mask
from runtime.monitoring.model import MonitoredModel
from runtime.monitoring.observer import ObserverSettings
from runtime.recording.preprocessing.filters import scipy_signal
from runtime.recording.preprocessing.segments import segments

KEPT = 0.6
"""Share of a low-pass's cut-off up to which it leaves a residual as it is (2 % in amplitude)."""
SLOW_HZ = 10.0
"""Frequency above which the noise of r is that of the observed log in any case: the residual of an
unfiltered log contains the derivative of a noisy speed, which the observer does not."""
AVERAGE_CUTOFF = 0.443  # cut-off of a moving average times its window
BLOCK_S = 0.25  # length of the blocks whose variance is compared, to leave out contacts [s]
LEAST_BLOCKS = 4  # blocks of the shortest stretch from which a variance is estimated
OUTLIER = 6.0  # variance of a block over the median of all, above which it counts as a contact
SLOW_CLASSES, FAST_CLASSES = 3, 12
"""Equally frequent classes of stretches by their variance, below f_s and above it. Slow residuals
are bounded: the Gaussian tail of finer classes would exceed any that is seen."""
MARGIN = 1.1  # threshold over the largest slow residual that was seen in free motion, at least
UNKNOWN = 0.01
"""Share of the friction with a memory below which the error of its first state is forgotten."""
REVERSAL_S = 0.1
"""Time after a reversal or a rest in which the direction of dry friction is uncertain [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutResidual:
    """Residual torque of the part of a log that the model has not seen."""

    t: Array  # (N,) with holes [s]
    rest: Array  # τ − τ̂, (N, n) [N·m, N]
    is_used: Mask  # (N, n), False next to reversals of a joint
    limit_hz: float  # frequency up to which it counts


@dataclass(frozen=True, slots=True, eq=False)
class ObserverNoise:
    """Noise of r in free motion, per joint."""

    slow: Array  # σ below f_s, of model and friction, (n,) [N·m, N]
    fast: Array  # σ above f_s, of sensors, (n,) [N·m, N]
    largest: Array  # largest |r| below f_s that free motion has shown, (n,) [N·m, N]
    correlation: Array  # ρ of neighbouring samples of r, (n,)
    ratios: Array  # σ of equally frequent stretches over that of all, (S, n)

    @property
    def sigma(self) -> Array:
        """σ of r, (n,) [N·m, N]."""
        return np.sqrt(self.slow**2 + self.fast**2)

    def thresholds(self, levels: Array, band: Array | float = 0.0) -> Array:
        """Thresholds z √(σ² + band²), not below what free motion has shown."""
        return np.maximum(levels * np.sqrt(self.sigma**2 + band**2), self.least)

    @property
    def least(self) -> Array:
        """Smallest thresholds, (n,) [N·m, N]."""
        return MARGIN * self.largest + self.fast


def read_held_out(result: Path, model: MonitoredModel) -> HeldOutResidual:
    """Residual on the test part, from predictions.npz of a result."""
    shape = (len(model.phi),)
    try:
        rows = read_predictions(result, measured=shape, after=shape, dq=shape)
        if not (np.diff(rows["t"]) > 0).all():
            raise RecordingError("t does not rise")
    except RecordingError as error:
        raise IdentificationError(
            f"the thresholds are computed from torques over the test part ({error}); identify "
            "again with this version and a regressor of torque"
        ) from None
    preparation, t, dq = model.preparation, rows["t"], rows["dq"]
    cutoff = {
        "butterworth": preparation.cutoff_hz,
        "average": preparation.window_s and AVERAGE_CUTOFF / preparation.window_s,
        "savitzky-golay": preparation.window_s and preparation.order / (2 * preparation.window_s),
    }.get(preparation.filter)
    travel = np.zeros_like(dq)
    for part in segments(t):
        steps = np.diff(t[part], prepend=t[part][:1])[:, None]
        travel[part] = np.cumsum(np.abs(dq[part]) * steps, axis=0)
    # The state of friction with a memory is not known yet.
    is_unknown = model.unknown_state(travel) > UNKNOWN * model.lasting_friction
    usable = ~near(t, model.is_slow(dq) | is_unknown, REVERSAL_S, REVERSAL_S)
    limit = min(KEPT * cutoff, SLOW_HZ) if cutoff else SLOW_HZ
    return HeldOutResidual(t, rows["measured"] - rows["after"], usable, limit)


def read_test_rows(result: Path, model: MonitoredModel) -> tuple[Array, Samples] | None:
    """Instants and samples of the test part; None where predictions.npz holds no accelerations."""
    n, k = model.phi.shape
    shapes = dict.fromkeys(("q", "dq", "ddq", "measured"), (n,))
    try:
        rows = read_predictions(result, **shapes, columns=(n, k))
    except RecordingError:
        return None
    t, q, dq, ddq, tau, columns = rows.values()
    return t, Samples(q, dq, ddq, tau, columns, coupling=model.coupling)


def near(t: Array, event: Mask, before_s: float, after_s: float) -> Mask:
    """Instants around those of an event: t (N,) [s], event (N, n) → (N, n)."""
    sums = np.vstack([np.zeros((1, event.shape[1]), int), np.cumsum(event, axis=0)])
    first = np.searchsorted(t, t - after_s - 1e-9)
    return np.asarray(sums[np.searchsorted(t, t + before_s + 1e-9, side="right")] > sums[first])


def noise_of_observer(
    settings: ObserverSettings, held_out: HeldOutResidual, t: Array, r: Array
) -> ObserverNoise:
    """Noise of r (N, n) [N·m, N] in free motion, t (N,) [s]."""
    limit = min(0.4 * settings.rate_hz, held_out.limit_hz)
    slow, cosine, largest, slow_blocks = _slow(settings, held_out, limit)
    fast, step, fast_blocks = _fast(settings.rate_hz, t, r, limit)
    total = np.maximum(slow + fast, 1e-300)
    correlation = (slow * cosine + fast - step / 2) / total
    correlation = np.clip(correlation, -0.999, 1 - 1e-9)
    shares = _classes(slow_blocks, slow, SLOW_CLASSES)[:, None]
    shares = shares + _classes(fast_blocks, fast, FAST_CLASSES)
    ratios = np.sqrt(shares.reshape(-1, shares.shape[2]) / total)
    return ObserverNoise(np.sqrt(slow), np.sqrt(fast), largest, correlation, ratios)


def _classes(blocks: Array, mean: Array, count: int) -> Array:
    """Variances of equally frequent classes of blocks (B, n) of a mean (n,), (count, n)."""
    shares = np.empty((count, len(mean)))
    for j, values in enumerate(blocks.T):
        known = np.sort(values[np.isfinite(values)])
        if len(known) < count or not known.any():
            shares[:, j] = mean[j]
            continue
        classes = np.array([part.mean() for part in np.array_split(known, count)])
        shares[:, j] = classes * (mean[j] / classes.mean())
    return shares


def _slow(
    settings: ObserverSettings, held_out: HeldOutResidual, limit: float
) -> tuple[Array, Array, Array, Array]:
    """Variance of r below the limit, E cos(2πfΔ) of its spectrum, largest |r|, (n,) each.

    The last array is the variance of blocks, (B, n), NaN where less than half of one counts.
    """
    n = held_out.rest.shape[1]
    power, cosines, largest, count = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    blocks = [np.empty((0, n))]
    for part in segments(held_out.t):
        usable = held_out.is_used[part]
        rest = held_out.rest[part] * usable
        if len(rest) < 2:
            continue
        step = float(np.median(np.diff(held_out.t[part])))
        hz = np.arange(len(rest)) / (2 * step * len(rest))
        kept = settings.gain(hz) * (hz <= limit)
        waves = dct(rest, axis=0, norm="ortho") * np.sqrt(kept)[:, None]
        power += np.sum(waves**2, axis=0)
        cosines += np.sum(waves**2 * np.cos(2 * np.pi * hz / settings.rate_hz)[:, None], axis=0)
        shown = idct(waves, axis=0, norm="ortho")
        largest = np.maximum(largest, np.abs(shown * usable).max(axis=0))
        count += usable.sum(axis=0)
        size = max(round(BLOCK_S / step), 1)
        whole = len(rest) // size * size
        squares = (shown**2 * usable)[:whole].reshape(-1, size, n).sum(axis=1)
        counted = usable[:whole].reshape(-1, size, n).sum(axis=1)
        blocks.append(np.where(2 * counted > size, squares / np.maximum(counted, 1), np.nan))
    safe = np.where(power > 0, power, 1.0)
    cosine = np.where(power > 0, cosines / safe, 1.0)
    return power / np.maximum(count, 1), cosine, largest, np.concatenate(blocks)


def _fast(rate_hz: float, t: Array, r: Array, limit: float) -> tuple[Array, Array, Array]:
    """Variance of r above the limit, and that of its differences, without blocks of contacts.

    The last array is the variance of blocks, (B, n), NaN for those of contacts.
    """
    signal = scipy_signal()
    sections = signal.butter(4, limit, "highpass", fs=rate_hz, output="sos")
    size = max(round(BLOCK_S * rate_hz), 8)
    squares, steps = [], []
    for part in segments(t):
        rows = r[part][np.isfinite(r[part]).all(axis=1)]
        if len(rows) < LEAST_BLOCKS * size:
            continue
        high = signal.sosfiltfilt(sections, rows, axis=0)
        high = high[: len(high) // size * size].reshape(-1, size, rows.shape[1])
        squares.append(np.mean(high**2, axis=1))
        steps.append(np.mean(np.diff(high, axis=1) ** 2, axis=1))
    if not squares:
        raise IdentificationError(
            f"the log holds no part of {LEAST_BLOCKS * size / rate_hz:g} s without a gap, from "
            "which the noise of the sensors could be estimated; give a longer log"
        )
    power, change = np.concatenate(squares), np.concatenate(steps)
    usual = power <= OUTLIER * np.median(power, axis=0)
    count = usual.sum(axis=0)
    mean, of_steps = ((each * usual).sum(axis=0) / count for each in (power, change))
    return mean, of_steps, np.where(usual, power, np.nan)


UNITS = {"second": 1.0, "minute": 60.0, "hour": 3600.0, "day": 86400.0, "week": 604800.0}
_SHORT = {"s": "second", "min": "minute", "h": "hour", "d": "day"}
_RATE = re.compile(r"\s*([0-9.eE+-]+)\s*(?:per|/)\s*([a-z]+?)s?\s*")
_POINTS = 400


@dataclass(frozen=True, slots=True)
class AlarmRate:
    """Rate of false alarms of all joints together."""

    text: str  # as the user stated it
    per_second: float  # the same [1/s]


def alarm_rate(text: str) -> AlarmRate:
    """Rate from words such as "1 per hour" or "0.5/day"."""
    match = _RATE.fullmatch(text)
    unit = "" if match is None else _SHORT.get(match[2], match[2])
    number = None if match is None else number_of(match[1])
    if number is None or unit not in UNITS or not 0 < number < 1e9:
        raise IdentificationError(
            f"expected a rate of false alarms such as '1 per hour' (units {', '.join(UNITS)}), got "
            f"'{text}'; correct the setting false_alarms"
        )
    return AlarmRate(text.strip(), number / UNITS[unit])


def crossing_rate(z: Array, correlation: Array, rate_hz: float) -> Array:
    """Rate of upward crossings of z σ by a Gaussian sequence: z, correlation (m,) → (m,) [1/s]."""
    rest = np.sqrt(np.maximum(1 - correlation**2, 1e-12))
    # Most of the integral lies within some of these widths below the level.
    width = np.minimum(8.0 * rest / np.maximum(1 + correlation, 1e-3) + 8.0 * rest, 40.0)
    x = z[:, None] - width[:, None] * ((np.arange(_POINTS) + 0.5) / _POINTS)
    tail = ndtr((correlation[:, None] * x - z[:, None]) / rest[:, None])
    density = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
    return np.asarray(rate_hz * (density * tail).mean(axis=1) * width)


def levels(rate: float, correlation: Array, rate_hz: float) -> Array:
    """Levels z (n,) at which all joints, of correlation (n,), together cross ±z σ at a rate."""
    each = rate / (2 * len(correlation))
    low, high = np.zeros(len(correlation)), np.full(len(correlation), 30.0)
    for _ in range(40):
        middle = (low + high) / 2
        is_rare = crossing_rate(middle, correlation, rate_hz) < each
        low, high = np.where(is_rare, low, middle), np.where(is_rare, middle, high)
    return high


def rate_by_stretches(z: Array, correlation: Array, rate_hz: float, ratios: Array) -> float:
    """Rate of crossings where the standard deviation differs from stretch to stretch."""
    scaled = np.minimum(z / np.maximum(ratios, 1e-9), 40.0)
    rho = np.broadcast_to(correlation, scaled.shape)
    rates = crossing_rate(scaled.ravel(), rho.ravel(), rate_hz).reshape(scaled.shape)
    return float(2 * rates.mean(axis=0).sum())
