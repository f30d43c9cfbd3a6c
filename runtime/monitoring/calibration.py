"""Thresholds that are fitted to free motion, and verification of a stated rate.

A joint raises an alarm where s = (|r| − extra)/σ exceeds its level z. The residuals of a model are
not Gaussian: friction that no column describes is bounded, and the noise of p grows with M(q). The
tail of s is therefore fitted to motion without contacts. Peaks s_i are separated as contacts are;
their excess over the (k + 1)-th largest one, u, has a generalised Pareto tail in the square,

    P(s² − u² > y) = (1 + ξ y/c)^(−1/ξ),   ξ ~ N(0, 0.1²),

whose centre ξ = 0 is the Gaussian tail. z solves (k/T) P(s > z) = rate/n. Source: Coles
2001, Ch. 4; Pickands 1975.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import pdtrc

from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.monitoring.contacts import PAUSE_S, RELEASE
from runtime.monitoring.observation import Detector, Signals, observe
from runtime.recording import Recording

PEAKS = 100
"""Largest number k of peaks per joint to which a tail is fitted."""
LEAST_PEAKS = 30
"""Smallest number of peaks."""
SHAPE = 0.1
"""Standard deviation of ξ before the peaks are seen."""
HIGH = 0.9
"""Quantile of s above which peaks are looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Tail:
    """Tail of the peaks of s of one joint.

    Attributes:
        peaks: the k + 1 largest ones, decreasing.
        seconds: duration in which they were seen [s].
        scale: c.
        shape: ξ.
    """

    peaks: Array
    seconds: float
    scale: float
    shape: float

    def level(self, rate: float) -> float:
        """Level that peaks exceed at a stated rate."""
        least = float(self.peaks[-1])
        rarity = np.log((len(self.peaks) - 1) / (rate * self.seconds))
        if rarity <= 0:
            return least
        small = abs(self.shape) < 1e-6
        excess = rarity if small else np.expm1(self.shape * rarity) / self.shape
        return float(np.sqrt(least**2 + self.scale * excess))


def peaks_of(s: Array, rate_hz: float) -> Array:
    """Peaks of one joint that would be contacts of their own.

    From the largest one downwards, a peak takes with it all samples until s has fallen below half
    of it, and those within the shortest pause of two contacts.
    """
    s = np.nan_to_num(s, nan=0.0)
    pause = max(round(PAUSE_S * rate_hz), 1)
    inner = (s[1:-1] >= s[:-2]) & (s[1:-1] > s[2:]) & (s[1:-1] > max(np.quantile(s, HIGH), 0.0))
    places = np.flatnonzero(inner) + 1
    is_free = np.ones(len(s), dtype=bool)
    peaks: list[float] = []
    for k in places[np.argsort(-s[places])]:
        if not is_free[k]:
            continue
        peaks.append(float(s[k]))
        if len(peaks) > PEAKS:
            break
        low = RELEASE * s[k]
        first, last = _edge(s, k, -1, low), _edge(s, k, 1, low)
        is_free[max(first - pause, 0) : last + pause + 1] = False
    return np.array(peaks)


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


def tail_of(peaks: Array, seconds: float) -> Tail:
    """Generalised Pareto tail of the squares of peaks, most probable a posteriori."""
    kept = np.sort(peaks)[::-1][: PEAKS + 1]
    excess = kept[:-1] ** 2 - kept[-1] ** 2
    mean = max(float(excess.mean()), 1e-300)
    y = excess / mean

    def loss(x: Array) -> float:
        """−log p(y | ln c, ξ) − log p(ξ)."""
        z = 1 + x[1] * y / np.exp(x[0])
        if z.min() <= 0:
            return float("inf")
        logs = np.log(z).sum() / x[1] if abs(x[1]) > 1e-6 else y.sum() / np.exp(x[0])
        return float(len(y) * x[0] + logs + np.log(z).sum() + (x[1] / SHAPE) ** 2 / 2)

    scale, shape = minimize(loss, [0.0, 0.01], method="Nelder-Mead").x
    return Tail(kept, seconds, float(mean * np.exp(scale)), float(shape))


def tails_of(signals: Iterable[Signals], rate_hz: float) -> tuple[Tail, ...]:
    """Tail of every joint over several logs."""
    by_log: list[list[Array]] = []
    seconds = 0.0
    for each in signals:
        s = each.normalised
        seconds += float(np.isfinite(s[:, 0]).sum() / rate_hz)
        by_log.append([peaks_of(column, rate_hz) for column in s.T])
    by_joint = [np.concatenate(parts) for parts in zip(*by_log, strict=True)]
    fewest = min(map(len, by_joint))
    if fewest <= LEAST_PEAKS:
        raise IdentificationError(
            f"expected free motion with {LEAST_PEAKS + 1} or more separate peaks of the residual "
            f"per joint, got {fewest} in {seconds:.3g} s; calibrate with a longer log"
        )
    return tuple(tail_of(peaks, seconds) for peaks in by_joint)


def calibrated(detector: Detector, tails: Sequence[Tail]) -> Detector:
    """The detector with levels from the tails of free motion."""
    each = detector.rate.per_second / len(tails)
    levels = np.array([tail.level(each) for tail in tails])
    noise = replace(detector.noise, largest=np.zeros(len(tails)))
    return replace(detector, levels=levels, noise=noise)


@dataclass(frozen=True, slots=True)
class FreeMotion:
    """Verification of the stated rate on a log of free motion.

    Attributes:
        alarms: number of alarms in it.
        expected: number that the stated rate gives for its duration.
        probability: of so many alarms or more at the stated rate.
    """

    alarms: int
    expected: float
    probability: float


def verified(lib: Library, detector: Detector, recording: Recording) -> FreeMotion:
    """Number of alarms in a log of free motion, against the stated rate."""
    seen = observe(lib, detector, recording)
    expected = detector.rate.per_second * seen.seconds
    alarms = len(seen.contacts)
    return FreeMotion(alarms, expected, float(pdtrc(alarms - 1, expected)) if alarms else 1.0)
