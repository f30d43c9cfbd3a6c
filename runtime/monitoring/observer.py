"""External joint torque by the generalised-momentum observer, sample by sample or for a whole log.

    r = K_O (p(t) − ∫ (τ_m − τ_f + Cᵀ dq − g + r) dt − p(0))

r follows τ_ext with bandwidth K_O. For inputs that are linear between samples at steps of Δ

    w_k = (p_k − p_{k−1})/Δ − (u_k + u_{k−1})/2,   r_k = a r_{k−1} + (1 − a) w_k,   a = exp(−K_O Δ)

with u = τ_m − τ_f + Cᵀ dq − g, so that w_k is the mean of τ_ext over a step. A window averages q,
dq and τ before; with `velocity = "position"` its mean speed is the difference of its ends,
which is cleaner than a measured speed where encoders are fine. Source: De Luca & Mattone 2003.

Contacts of a log: where the external torque exceeds its threshold, with time, joint and size.

The contact wrench at a link follows from the external joint torque,

    τ_ext = J(q)ᵀ w,   w = (force, moment) at the origin of the link, axes of the base

With fewer than six joints before the link, or in a singular posture, only some components follow
from τ_ext. w is the smallest one that explains it; lengths are scaled by `LENGTH`.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.monitoring.model import AnyModel, MonitoredModel, model_of
from runtime.recording import Recording
from runtime.recording.preprocessing.filters import scipy_signal
from runtime.recording.preprocessing.segments import segments
from runtime.recording.recording import motion_for
from runtime.recording.settings import JointMotion

BANDWIDTH = 100.0  # K_O of the observer unless it is stated [1/s]
VELOCITIES = ("measured", "position")


@dataclass(frozen=True, slots=True)
class ObserverSettings:
    """Discrete observer."""

    rate_hz: float  # rate of the samples [Hz]
    bandwidth: float = BANDWIDTH  # K_O [1/s]
    steps: int = 0  # length of the averaging window in steps of time, 0 for none
    # "measured" takes dq, "position" the difference of q over the window
    velocity: str = "measured"

    def __post_init__(self) -> None:
        for what, value in (("a rate in Hz", self.rate_hz), ("a bandwidth in 1/s", self.bandwidth)):
            if not 0 < value < np.inf:
                raise IdentificationError(f"expected {what} above 0, got {value:g}; correct it")
        if self.velocity not in VELOCITIES:
            raise IdentificationError(
                f"expected a velocity of {', '.join(VELOCITIES)}, got {self.velocity!r:.40}; "
                "choose one of them"
            )
        if self.steps < (self.velocity == "position"):
            raise IdentificationError(
                f"expected a window of {int(self.velocity == 'position')} steps or more for the "
                f"velocity '{self.velocity}', got {self.steps}; enlarge it"
            )

    @property
    def decay(self) -> float:
        """a = exp(−K_O Δ)."""
        return float(np.exp(-self.bandwidth / self.rate_hz))

    def response(self, seconds: float) -> float:
        """Share of a step of τ_ext that r shows after some time, in (0, 1)."""
        lag, window = self.bandwidth, self.steps / self.rate_hz
        if not window:
            return float(1 - np.exp(-lag * seconds))
        ramp = min(seconds, window)
        # Step response of the window, a ramp, through 1/(1 + s/K_O).
        rise = (ramp - (1 - np.exp(-lag * ramp)) / lag) / window
        return float(1 - (1 - rise) * np.exp(-lag * (seconds - ramp)))

    def gain(self, hz: Array) -> Array:
        """|H(f)|² from τ_ext to r, same shape as the frequencies [Hz]."""
        lag = 1 / (1 + (2 * np.pi * hz / self.bandwidth) ** 2)
        return np.asarray(lag * np.sinc(hz * self.steps / self.rate_hz) ** 2)


def observer_settings(
    rate_hz: float, within_s: float, steps: int, velocity: str
) -> ObserverSettings:
    """Observer in which r shows 95 % of a step after a stated time."""
    if not steps / rate_hz < within_s:
        raise IdentificationError(
            f"expected a window shorter than the {within_s:g} s in which a step is shown, got "
            f"{steps / rate_hz:g} s; shorten it"
        )
    low, high = 1.0 / within_s, 1e4 / within_s
    for _ in range(60):  # the response rises with the bandwidth
        middle = np.sqrt(low * high)
        shown = ObserverSettings(rate_hz, float(middle), steps, velocity).response(within_s)
        low, high = (low, middle) if shown > 0.95 else (middle, high)
    return ObserverSettings(rate_hz, float(high), steps, velocity)


class Observer:
    """External joint torque, sample by sample.

    Args:
        lib: library of the robot.
        identified: an `Identification`, a result that was read, or a model of this package.
        rate_hz: rate of the samples [Hz].
        bandwidth: K_O [1/s].
        window_s: length of the averaging window [s]; 0 for none.
        velocity: "measured" or "position".

    Raises:
        IdentificationError: a setting is out of range.
    """

    def __init__(
        self,
        lib: Library,
        identified: AnyModel,
        *,
        rate_hz: float,
        bandwidth: float = BANDWIDTH,
        window_s: float = 0.0,
        velocity: str = "measured",
    ) -> None:
        steps = round(window_s * rate_hz)
        self.settings = ObserverSettings(rate_hz, bandwidth, steps, velocity)
        self._lib, self._model = lib, model_of(identified, lib)
        self._has_memory = bool(self._model.memory.any())
        # Columns that need further signals are refused before the first sample.
        still, place, zeta = np.zeros((3, 1, lib.n_joints))
        self._model.columns(JointMotion(still, place, lib=lib, zeta=zeta))
        # A torque that is logged late belongs to an earlier state, and one logged early to a later.
        delay = self._model.delay_s * rate_hz
        self._late = max(delay, 0.0), max(-delay, 0.0)
        self._states: deque[Array] = deque(maxlen=int(np.ceil(self._late[0])) + 2)
        self._torques: deque[Array] = deque(maxlen=int(np.ceil(self._late[1])) + 2)
        self._window: deque[Array] = deque(maxlen=steps + 1)
        self.reset()

    def reset(self) -> None:
        """Forget all samples, as after a pause of the log."""
        for queue in (self._states, self._torques, self._window):
            queue.clear()
        self._last: tuple[Array, Array] | None = None
        self._place: Array | None = None
        self._r, self._zeta = np.zeros((2, self._lib.n_joints))

    def update(self, q: ArrayLike, dq: ArrayLike, tau: ArrayLike) -> Array:
        """Add one sample.

        Args:
            q: (n,) joint positions [rad, m].
            dq: (n,) joint velocities [rad/s, m/s].
            tau: (n,) torques of the motors [N·m, N].

        Returns:
            r, (n,) [N·m, N]; 0 until the window is full. A sample that is not finite is left out.

        Raises:
            IdentificationError: the shapes do not fit.
        """
        sample = [np.asarray(each, dtype=float) for each in (q, dq, tau)]
        n = self._lib.n_joints
        if any(each.shape != (n,) for each in sample):
            raise IdentificationError(
                f"expected q, dq and tau of shape ({n},), got "
                f"{', '.join(str(each.shape) for each in sample)}; give one row per sample"
            )
        if not all(np.isfinite(each).all() for each in sample):
            return self._r.copy()
        self._states.append(np.stack(sample[:2]))
        self._torques.append(sample[2])
        if len(self._states) <= self._late[0] or len(self._torques) <= self._late[1]:
            return self._r.copy()
        state = _delayed(self._states, self._late[0])
        self._window.append(np.vstack([state, _delayed(self._torques, self._late[1])]))
        s = self.settings
        if len(self._window) <= s.steps:
            return self._r.copy()
        rows = np.stack(self._window)
        mean: Array = np.asarray(np.trapezoid(rows, axis=0) / s.steps) if s.steps else rows[0]
        speed = mean[1]
        if s.velocity == "position":
            speed = (rows[-1, 0] - rows[0, 0]) * (s.rate_hz / s.steps)
        zeta = self._advanced(mean[0])[None] if self._has_memory else None
        motion = JointMotion(speed[None], mean[None, 0], lib=self._lib, zeta=zeta)
        p, force = self._model.balance(self._lib, motion)
        now = p[0], mean[2] + force[0]
        if self._last is not None:
            w = (now[0] - self._last[0]) * s.rate_hz - (now[1] + self._last[1]) / 2
            self._r = s.decay * self._r + (1 - s.decay) * w
        self._last = now
        return self._r.copy()

    def _advanced(self, q: Array) -> Array:
        """State ζ of the friction with a memory after a step, as the column `dahl` has it."""
        if self._place is not None:
            step = q - self._place
            drive, stroke = np.sign(step), self._model.terms.dahl_stroke
            self._zeta = drive + (self._zeta - drive) * np.exp(-np.abs(step) / stroke)
        self._place = q
        return self._zeta


def _delayed(queue: deque[Array], late: float) -> Array:
    """Entry `late` steps before the last one, linear between entries."""
    whole = int(late)
    share, newer = late - whole, queue[-1 - whole]
    return newer if share == 0.0 else (1 - share) * newer + share * queue[-2 - whole]


def windows(
    lib: Library, model: MonitoredModel, settings: ObserverSettings, log: Recording
) -> Iterator[tuple[slice, JointMotion, Array]]:
    """Rows of every segment that end a window, and means over it of the motion and of τ."""
    steps, tau = settings.steps, log.required("tau")
    whole = motion_for(log, model.terms.columns, lib)
    for part in segments(log.t):
        if part.stop - part.start <= steps + 1:
            continue
        q = log.q[part]
        position, speed, torque = (
            window_mean(settings, each) for each in (q, whole.dq[part], tau[part])
        )
        if steps and settings.velocity == "position":
            speed = (q[steps:] - q[:-steps]) * (settings.rate_hz / steps)
        signals = {key: window_mean(settings, x[part]) for key, x in whole.signals.items()}
        motion = JointMotion(speed, position, lib=lib, signals=signals)
        yield slice(part.start + steps, part.stop), motion, torque


def window_mean(settings: ObserverSettings, values: Array) -> Array:
    """Means of a signal over the window that ends at each sample, (N − steps, n)."""
    steps = settings.steps
    if not steps:
        return values
    halves = (values[:-1] + values[1:]) / 2
    sums = np.cumsum(np.vstack([np.zeros((1, values.shape[1])), halves]), axis=0)
    return np.asarray((sums[steps:] - sums[:-steps]) / steps)


def external_torques(
    lib: Library,
    model: MonitoredModel,
    settings: ObserverSettings,
    log: Recording,
    overs: tuple[int, ...] = (1,),
) -> tuple[Array, ...]:
    """r (N, n) of a whole log for one step; for more, dp/dt − u over them, not low-passed.

    The observer starts again after each hole of the clock.
    """
    decay, tau = settings.decay, log.required("tau")
    result = tuple(np.full_like(tau, np.nan) for _ in overs)
    for rows, motion, torque in windows(lib, model, settings, log):
        if len(torque) <= max(overs):
            continue
        p, force = model.balance(lib, motion)
        rate = torque + force
        for r, over in zip(result, overs, strict=True):
            change = (p[over:] - p[:-over]) * (settings.rate_hz / over)
            if over > 1:
                value = change - (tau[rows][over:] + force[over:])
            else:
                w = change - (rate[1:] + rate[:-1]) / 2
                value = scipy_signal().lfilter([1 - decay], [1, -decay], w, axis=0)
            r[rows][over:] = value
    return result


LENGTH = 0.1  # length that makes moments comparable to forces [m]
DETERMINED = 0.02
"""Singular value of the scaled Jacobian, relative to the largest, from which one counts."""
RELEASE = 0.5  # share of the threshold below which a contact ends
PAUSE_S = 0.05  # shortest pause between two contacts of one joint [s]


@dataclass(frozen=True, slots=True)
class Wrench:
    """Contact wrench at the origin of a link, in axes of the base."""

    link: str  # name of the link
    force: tuple[float, ...]  # (3,) [N]
    moment: tuple[float, ...]  # (3,) [N·m]
    rank: int  # number of its six components that the external torque determines


def wrench_at(lib: Library, q: Array, external: Array, name: str) -> Wrench:
    """Contact wrench at a link by least squares: q (n,) [rad, m], external (n,) [N·m, N]."""
    if name not in lib.link_names:
        raise IdentificationError(
            f"expected a moving link of '{lib.name}' ({', '.join(lib.link_names)}), got '{name}'; "
            "correct the setting link"
        )
    scale = np.repeat([1.0, LENGTH], 3)
    jacobian = lib.frame_jacobian(q, name) * scale[:, None]
    least, _, rank, _ = np.linalg.lstsq(jacobian.T, external, rcond=DETERMINED)
    w = (least * scale).tolist()
    return Wrench(name, tuple(w[:3]), tuple(w[3:]), int(rank))


@dataclass(frozen=True, slots=True)
class Contact:
    """One contact at one joint."""

    time_s: float  # instant at which the threshold is exceeded [s]
    end_s: float  # instant from which r stays below half of it [s]
    joint: str  # name of the joint
    number: int  # index of the joint, from 0
    torque: float  # external torque [N·m, N]: median after the time of the observer, or the peak
    direction: int  # sign of it, 1 or −1
    sigma: float  # σ of r at the instant of detection [N·m, N]
    threshold: float  # at that instant [N·m, N]


def contacts_of(
    t: Array, r: Array, sigma: Array, threshold: Array, names: Sequence[str], within_s: float
) -> tuple[Contact, ...]:
    """Contacts in the order of time.

    t (N,) [s], r (N, n) [N·m, N], sigma (N, n) [N·m, N], threshold (N, n) [N·m, N].
    """
    contacts, sizes = [], np.abs(np.nan_to_num(r))
    for j, name in enumerate(names):
        size = sizes[:, j]
        for first, last in _intervals(t, size, threshold[:, j]):
            shown = first + int(np.searchsorted(t[first : last + 1] - t[first], within_s))
            inside = r[first : last + 1, j]
            held = size[shown : last + 1] > RELEASE * threshold[shown : last + 1, j]
            torque = float(inside[np.argmax(np.abs(inside))])
            if held.sum() > 2:
                torque = float(np.median(r[shown : last + 1, j][held]))
            contacts.append(
                Contact(
                    time_s=float(t[first]),
                    end_s=float(t[last]),
                    joint=name,
                    number=j,
                    torque=torque,
                    direction=1 if torque > 0 else -1,
                    sigma=float(sigma[first, j]),
                    threshold=float(threshold[first, j]),
                )
            )
    return tuple(sorted(contacts, key=lambda contact: contact.time_s))


def _intervals(t: Array, size: Array, threshold: Array) -> list[tuple[int, int]]:
    """First and last sample of each contact: from above the threshold to below half of it."""
    above = np.flatnonzero(size > threshold)
    below = np.flatnonzero(size < RELEASE * threshold)
    intervals: list[tuple[int, int]] = []
    for k in above:
        if intervals and (k <= intervals[-1][1] or t[k] - t[intervals[-1][1]] < PAUSE_S):
            if k <= intervals[-1][1]:
                continue
            first = intervals.pop()[0]
        else:
            first = int(k)
        after = np.searchsorted(below, k)
        last = int(below[after]) if after < len(below) else len(size) - 1
        intervals.append((first, last))
    return intervals
