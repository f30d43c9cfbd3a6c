"""Thresholds that are fitted to free motion, and verification of a stated rate.

A joint raises an alarm where s = (|r| − w extra)/σ exceeds its level z, with w = 0 or 1, whichever
gives the smaller thresholds, and σ of r in free motion. The residuals of a model are
not Gaussian: friction that no column describes is bounded, and the noise of p grows with M(q). The
tail of s is therefore fitted to motion without contacts. Peaks s_i are separated as contacts are;
their excess over the (k + 1)-th largest one, u, has a generalised Pareto tail in the square,

    P(s² − u² > y) = (1 + ξ y/c)^(−1/ξ),   ξ ~ N(0, 0.1²),

whose centre ξ = 0 is the Gaussian tail; ξ is common to the joints. z solves (k/T) P(s > z) = rate/n
in the mean over the posterior of ξ and c. Runs of exceedances count once, so that no extremal index
of coloured noise is assumed. Motions differ: one that excites an error of the model has many peaks.
With φ the variance over the mean of their number in `DAY_S`, k peaks count as k/φ independent ones.
Free motion is usually of one day, and the friction of another day is
another one: the logs are taken with friction that changes (`on_other_days`).
Source: Coles 2001, Ch. 4 and 5; Pickands 1975.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import boxcox, pdtrc

from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.monitoring.model import MonitoredModel
from runtime.monitoring.observation import Detector, both_torques, observe, signals_of, usual_torque
from runtime.monitoring.observer import PAUSE_S, RELEASE
from runtime.recording import Recording
from runtime.recording.friction.model import LARGE_DAY
from runtime.recording.recording import motion_for

PEAKS = 100
"""Largest number k of peaks per joint to which a tail is fitted: with more, the body of the
distribution determines its shape."""
LEAST_PEAKS = 30  # smallest number of peaks of the joint that has most; one that rests has fewer
SHAPE = 0.1  # standard deviation of ξ before the peaks are seen
LEAST_S = 10.0  # shortest free motion [s]
LEAST_LEVEL = 4.0  # smallest level of a joint with fewer peaks than that
DIRECT_LOWER = 1.1
"""Threshold of the direct torque over that of r, below which it is used: it is faster."""
DIRECT_OF_DIFFERENCES = 1.5
"""The same where dq is a difference of positions. Its noise grows with the speed, by stamps that
jitter, so that r has false alarms in motions faster than the calibration; the direct torque
contains less of it, by `DIRECT_S` over a step."""
_SHAPES = np.arange(-0.495, 0.5, 0.03)
_LOG_SCALES = np.linspace(-1.2, 0.8, 101)
"""Grid of the posterior: ξ, and ln c relative to the mean excess."""
_DRAWS = 2000
DAY_S = 20.0
"""Time in which all friction is drawn anew [s]: half an hour of one day has 90 other days."""
ENOUGH, USUAL = 0.4, 0.5
"""Stated alarms in the free motion below which it is too short for its rate, and those of half an
hour at one per hour. Minutes contain few motions: with levels of one minute an arm had 11 to 83
alarms per hour where a tail of that minute has up to 6."""
NONE_SEEN = 3.689  # mean of a Poisson count that is 0 with a probability of 2.5 %
HIGH = 0.9  # quantile of s above which peaks are looked for


@dataclass(frozen=True, slots=True, eq=False)
class Tail:
    """Tail of the peaks of s of one joint."""

    peaks: Array  # the k + 1 largest ones, decreasing
    seconds: float  # duration in which they were seen [s]
    scale: float  # c
    shape: float  # ξ
    cluster: float = 1.0  # φ

    @property
    def count(self) -> float:
        """Number of independent peaks above the lowest one, k/φ."""
        return (len(self.peaks) - 1) / self.cluster

    def level(self, rate: float) -> float:
        """Level that peaks exceed at a stated rate."""
        rarity = max((len(self.peaks) - 1) / (rate * self.seconds), 1.0)
        return float(np.sqrt(self.peaks[-1] ** 2 + self.scale * boxcox(rarity, self.shape)))


def peaks_of(s: Array, rate_hz: float) -> Array:
    """Peaks of one joint that would be contacts of their own, and their times [s]: (2, K).

    From the largest one downwards, a peak takes with it all samples until s has fallen below half
    of it, and those within the shortest pause of two contacts.
    """
    s, pause = np.nan_to_num(s, nan=0.0), max(round(PAUSE_S * rate_hz), 1)
    inner = (s[1:-1] >= s[:-2]) & (s[1:-1] > s[2:]) & (s[1:-1] > max(np.quantile(s, HIGH), 0.0))
    places, is_free = np.flatnonzero(inner) + 1, np.ones(len(s), dtype=bool)
    peaks: list[tuple[float, float]] = []
    for k in places[np.argsort(-s[places])]:
        if not is_free[k]:
            continue
        peaks.append((float(s[k]), k / rate_hz))
        if len(peaks) > PEAKS:
            break
        low = RELEASE * s[k]
        first, last = _edge(s, k, -1, low), _edge(s, k, 1, low)
        is_free[max(first - pause, 0) : last + pause + 1] = False
    return np.array(peaks).reshape(-1, 2).T


def _edge(s: Array, k: int, way: int, low: float) -> int:
    """Last index in one direction before s falls below a level."""
    size = 256
    while True:
        part = s[k : k + size] if way > 0 else s[max(k - size, 0) + 1 : k + 1][::-1]
        below = np.flatnonzero(part < low)
        if len(below):
            return int(k + way * (below[0] - 1))
        if len(part) < size:
            return int(k + way * (len(part) - 1))
        size *= 4


def _weights(tails: Sequence[Tail]) -> tuple[Array, list[Array], list[Array]]:
    """p(ξ | all joints), and per joint p(c | ξ) with the scales c."""
    log_shape = -((_SHAPES / SHAPE) ** 2) / 2
    xi, log_c = _SHAPES[:, None, None], _LOG_SCALES[None, :, None]
    given, scales = [], []
    for tail in tails:
        excess = tail.peaks[:-1] ** 2 - tail.peaks[-1] ** 2
        mean = max(float(excess.mean()), 1e-300)
        scales.append(mean * np.exp(_LOG_SCALES))
        # log p(excesses | ξ, c)/φ on the grid of ξ, which does not contain 0, and ln c, (G, H).
        z = 1 + xi * (excess / mean) / np.exp(log_c)
        logs = np.log(z, out=np.full_like(z, np.nan), where=z > 0)
        values = -len(excess) * _LOG_SCALES - ((1 / xi + 1) * logs).sum(axis=2)
        values = np.where(np.isfinite(values), values, -np.inf) / tail.cluster
        top = values.max(axis=1, keepdims=True)
        shares = np.exp(values - np.where(np.isfinite(top), top, 0.0))
        total = shares.sum(axis=1)
        log_shape = log_shape + np.log(np.maximum(total, 1e-300)) + top[:, 0]
        given.append(shares / np.maximum(total, 1e-300)[:, None])
    weights = np.exp(log_shape - log_shape.max())
    return weights / weights.sum(), given, scales


def highest(peaks: Array, seconds: float) -> Tail:
    """Largest peaks of a joint, from all with their times (2, K), before the tail is fitted."""
    if peaks.shape[1] < 2:  # the joint has lower ones, at most, and one of the size of σ
        return Tail(np.sort([*peaks[0], 1.0, RELEASE])[::-1], seconds, 0.0, 0.0)
    kept = peaks[:, np.argsort(-peaks[0])[: PEAKS + 1]]
    windows = int(seconds / DAY_S)
    counts = np.bincount((kept[1, :-1] / DAY_S).astype(int), minlength=windows)[:windows]
    cluster = counts.var() / counts.mean() if counts.any() else 1.0
    return Tail(kept[0], seconds, 0.0, 0.0, max(float(cluster), 1.0))


def fitted(start: Sequence[Tail]) -> tuple[Tail, ...]:
    """Tails of several joints with a common shape, most probable a posteriori."""
    shapes, given, scales = _weights(start)
    best = int(np.argmax(shapes))
    return tuple(
        replace(tail, scale=float(scale[np.argmax(share[best])]), shape=float(_SHAPES[best]))
        for tail, share, scale in zip(start, given, scales, strict=True)
    )


def _rates(tails: Sequence[Tail], scales: Sequence[Array], levels: Array) -> list[Array]:
    """Per joint the rate at a level over ξ and c [1/s]."""
    rates = []
    for tail, scale, level in zip(tails, scales, levels, strict=True):
        y = max(level**2 - tail.peaks[-1] ** 2, 0.0) / scale
        beyond = np.maximum(1 + _SHAPES[:, None] * y, 0.0) ** (-1 / _SHAPES[:, None])
        rates.append(beyond * ((len(tail.peaks) - 1) / tail.seconds))
    return rates


def levels_of(tails: Sequence[Tail], rate: float) -> Array:
    """Levels at which every joint has an n-th of a rate, in the mean over the posterior."""
    low = np.array([tail.peaks[-1] for tail in tails])
    high = 1e3 * np.maximum(low, 1.0)
    shapes, given, scales = _weights(tails)
    for _ in range(60):
        middle = (low + high) / 2
        rates = _rates(tails, scales, middle)
        mean = [shapes @ (w * r).sum(axis=1) for w, r in zip(given, rates, strict=True)]
        is_rare = np.array(mean) < rate / len(tails)
        low, high = np.where(is_rare, low, middle), np.where(is_rare, middle, high)
    is_thin = np.array([len(tail.peaks) <= LEAST_PEAKS for tail in tails])
    return np.where(is_thin, np.maximum(high, LEAST_LEVEL), high)


def is_short(tails: Sequence[Tail], rate: float) -> bool:
    """Whether free motion is too short for a stated rate [1/s]."""
    return rate * tails[0].seconds < ENOUGH


def rate_interval(
    tails: Sequence[Tail], levels: Array, stated: float | None = None
) -> tuple[float, float]:
    """95 % interval of the rate that levels have, from the posterior of the tails [1/s].

    The number of peaks above the lowest one has a Poisson distribution. Where free motion is too
    short for the stated rate [1/s], the interval contains what no alarm in that time excludes.
    """
    rng = np.random.default_rng(0)
    shapes, given, scales = _weights(tails)
    rates = _rates(tails, scales, levels)
    drawn = rng.choice(len(shapes), size=_DRAWS, p=shapes)
    total = np.zeros(_DRAWS)
    for tail, share, rate in zip(tails, given, rates, strict=True):
        sums = np.cumsum(share[drawn], axis=1)
        column = (sums < rng.uniform(size=(_DRAWS, 1)) * sums[:, -1:]).sum(axis=1)
        share_of = rng.gamma(tail.count, size=_DRAWS) / tail.count
        total += rate[drawn, np.minimum(column, rate.shape[1] - 1)] * share_of
    low, high = map(float, np.quantile(total, [0.025, 0.975]))
    if stated is not None and is_short(tails, stated):
        high = max(high, NONE_SEEN / tails[0].seconds)
    return low, high


def on_other_days(
    lib: Library, model: MonitoredModel, logs: Sequence[Recording], rng: np.random.Generator
) -> list[Recording]:
    """Logs with the friction of other days: viscous and dry parts times 1 + a(t), a ~ N(0, s²).

    a changes smoothly from one draw to the next: a(t) = cos θ a_k + sin θ a_{k+1}.
    """
    changed = []
    for log in logs:
        parts = model.session_features(motion_for(log, model.terms.columns, lib))[:, :, 1:]
        place = (log.t - log.t[0]) / DAY_S
        first = place.astype(int)
        draws = LARGE_DAY * rng.normal(size=(first[-1] + 2, *parts.shape[1:]))
        angle = (np.pi / 2 * (place - first))[:, None, None]
        factors = np.cos(angle) * draws[first] + np.sin(angle) * draws[first + 1]
        changed.append(log.replace(tau=log.required("tau") + np.sum(parts * factors, axis=2)))
    return changed


def calibrated_on(
    lib: Library, detector: Detector, logs: Sequence[Recording], has_speeds: bool = True
) -> tuple[Detector, tuple[Tail, ...]]:
    """The detector with scales, terms and levels from free motion, and the tails of its joints.

    Logs are prepared, of one day or of several; has_speeds states whether their dq was measured.
    """
    logs = on_other_days(lib, detector.model, logs, np.random.default_rng(0))
    plain, direct = _scaled(lib, detector, logs)
    rate_hz, rate = detector.settings.rate_hz, detector.rate.per_second
    # r without and with dry friction and timing, and the direct torque.
    ways = ((plain, 0.0), (plain, 1.0), (direct, 0.0))
    peaks: list[list[list[Array]]] = [[], [], []]
    seconds, extra, thresholds, tails = 0.0, [], [], []
    for log in logs:
        torques = both_torques(lib, detector.model, detector.settings, log)
        seen = {id(each): signals_of(lib, each, log, torques) for each in (plain, direct)}
        extra.append(seen[id(plain)].extra.mean(axis=0))
        for (each, share), kept in zip(ways, peaks, strict=True):
            start = [[0.0], [seconds]]
            kept.append([peaks_of(s, rate_hz) + start for s in seen[id(each)].normalised(share).T])
        seconds += float(np.isfinite(torques[0][:, 0]).sum() / rate_hz)
    for (each, share), kept in zip(ways, peaks, strict=True):
        by_joint = [np.hstack(parts) for parts in zip(*kept, strict=True)]
        most = max(each.shape[1] for each in by_joint)
        if each is plain and (most <= LEAST_PEAKS or seconds < LEAST_S):
            raise IdentificationError(
                f"expected {LEAST_S:g} s of free motion or more, with {LEAST_PEAKS + 1} separate "
                f"peaks of a residual, got {most} in {seconds:.3g} s; calibrate with a longer log"
            )
        tails.append(fitted([highest(peaks, seconds) for peaks in by_joint]))
        size = levels_of(tails[-1], rate) * each.noise.sigma + share * np.mean(extra, axis=0)
        thresholds.append(size)
    share = int(np.log(thresholds[1]).sum() < np.log(thresholds[0]).sum())
    lower = DIRECT_LOWER if has_speeds else DIRECT_OF_DIFFERENCES
    is_direct = thresholds[2] < lower * thresholds[share]
    noise = replace(
        plain.noise,
        slow=np.where(is_direct, direct.noise.slow, plain.noise.slow),
        fast=np.where(is_direct, direct.noise.fast, plain.noise.fast),
    )
    kept_tails = fitted([tails[2 if each else share][j] for j, each in enumerate(is_direct)])
    shares = np.where(is_direct, 0.0, float(share))
    detector = replace(plain, noise=noise, share=shares, is_direct=is_direct)
    return calibrated(detector, kept_tails), kept_tails


def _scaled(
    lib: Library, detector: Detector, logs: Sequence[Recording]
) -> tuple[Detector, Detector]:
    """The detector with σ of r in free motion, and that of the direct torque."""
    squares, count = np.zeros((2, lib.n_joints)), np.zeros((2, lib.n_joints))
    s = detector.settings
    for log in logs:
        r, direct, features = both_torques(lib, detector.model, s, log)
        for k, torque in enumerate((r, direct)):
            rough = np.nanstd(torque, axis=0)
            usual, variance = usual_torque(torque, features, rough, s.rate_hz)
            rest = np.where(variance < rough**2, torque - usual, np.nan)
            squares[k] += np.nansum(rest**2, axis=0)
            count[k] += np.isfinite(rest).sum(axis=0)

    def scaled(sigma: Array, is_direct: bool) -> Detector:
        fast, still = np.minimum(detector.noise.fast, sigma), np.zeros(lib.n_joints)
        noise = replace(detector.noise, slow=np.sqrt(sigma**2 - fast**2), fast=fast, largest=still)
        # Residuals of free motion contain the error of the model.
        return replace(detector, noise=noise, is_direct=is_direct, root=None)

    of_r, of_direct = np.sqrt(squares / np.maximum(count, 1))
    return scaled(of_r, False), scaled(of_direct, True)


def calibrated(detector: Detector, tails: Sequence[Tail]) -> Detector:
    """The detector with levels from the tails of free motion."""
    noise = replace(detector.noise, largest=np.zeros(len(tails)))
    return replace(detector, levels=levels_of(tails, detector.rate.per_second), noise=noise)


@dataclass(frozen=True, slots=True)
class FreeMotion:
    """Verification of the stated rate on a log of free motion."""

    alarms: int  # number of alarms in it
    expected: float  # number that the stated rate gives for its duration
    probability: float  # of so many alarms or more at the stated rate


def verified(lib: Library, detector: Detector, recording: Recording) -> FreeMotion:
    """Number of alarms in a log of free motion, against the stated rate."""
    seen = observe(lib, detector, recording)
    expected, alarms = detector.rate.per_second * seen.seconds, len(seen.contacts)
    return FreeMotion(alarms, expected, float(pdtrc(alarms - 1, expected)) if alarms else 1.0)
