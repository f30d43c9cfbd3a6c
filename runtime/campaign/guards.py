"""Guards: what every sample of a motion must fulfil, else the robot stops.

Before an arm is identified they use the bodies of the URDF, and the usual error of such a model.
"""

from collections.abc import Callable, Sequence

import numpy as np

from runtime.campaign.driver import Guard, Reference, Sample
from runtime.errors import IdentificationError
from runtime.excitation.limits.nonlinear_limits import (
    DependentJoints,
    dependent_limits,
    dependent_rows,
)
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.monitoring.model import urdf_model
from runtime.monitoring.observer import Observer

MARGIN = 0.05  # share of velocity and torque limits that a sample may exceed, for noise
TRACKING = 0.02  # largest distance from the commanded position, as a share of the range of a joint
WIDEST = 0.05  # upper bound of that distance [rad, m]
BANDWIDTH = 1000.0
WINDOW = 0.003  # bandwidth [1/s] and window [s] of the observer: 96 % of a step after 5 ms
ACCELERATION_NOISE = 1.0  # σ of M⁻¹ r by speeds at that bandwidth [rad/s², m/s²], 10 µrad encoders
LEVEL = 5.0
"""Standard deviations from which an external torque stops the robot; a virtual FR3 at full speed
reached 4.2 in 30 s of free motion."""
LATE = 3.0  # periods without a sample after which data are stale; a jump of the robot's clock alike
MODEL_ERROR = (0.006, 0.03, 0.5)
"""σ of the modelled torque of an arm that is not identified: 0.6 % of the effort limit, at least
0.5 N·m, at most 3 %; friction of wrists is that large."""


class LimitsGuard:
    """Limits of the joints, also of those that follow several others or that a loop moves."""

    name = "limits"

    def __init__(self, lib: Library) -> None:
        self._names = lib.joint_names
        limits = lib.limits()
        self._lower, self._upper = limits["lower"], limits["upper"]
        self._fastest, self._most = ((1 + MARGIN) * limits[k] for k in ("velocity", "effort"))
        self._dependent = DependentJoints(lib, dependent_rows(lib))
        low, high, speed = dependent_limits(lib, self._dependent.rows)
        self._ends, self._speed = (low, high), (1 + MARGIN) * speed

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on the first limit that is exceeded."""
        read = {"position": sample.q, "velocity": sample.dq, "torque": sample.tau}
        for what, values in read.items():
            if not np.isfinite(values).all():
                j = int(np.argmin(np.isfinite(values)))
                return f"expected a finite {what} of {self._names[j]}, got {values[j]}"
        return (
            _outside(self._names, sample.q, self._lower, self._upper)
            or _beyond("velocity", self._names, sample.dq, self._fastest)
            or _beyond("torque", self._names, sample.tau, self._most)
            or self._of_dependents(sample)
        )

    def _of_dependents(self, sample: Sample) -> str | None:
        """Sentence on the first dependent joint beyond its limits, or on a loop that is open."""
        if not self._dependent.rows:
            return None
        states = np.stack([sample.q, sample.dq, np.zeros_like(sample.q)])[:, None]
        x, dx, _ = (values[0] for values in self._dependent.motion(states))
        names = self._dependent.names
        if not np.isfinite(x).all():
            j = int(np.argmin(np.isfinite(x)))
            return f"expected positions at which the loop of {names[j]} closes, got {sample.q}"
        return _outside(names, x, *self._ends) or _beyond("velocity", names, dx, self._speed)


def _outside(names: Sequence[str], q: Array, lower: Array, upper: Array) -> str | None:
    """Sentence on the first joint outside its range."""
    outside = (q < lower) | (q > upper)
    if not outside.any():
        return None
    j = int(np.argmax(outside))
    return f"expected {names[j]} in [{lower[j]:.4g}, {upper[j]:.4g}], got {q[j]:.4g}"


def _beyond(what: str, names: Sequence[str], values: Array, most: Array) -> str | None:
    """Sentence on the first joint whose value exceeds its limit."""
    beyond = np.abs(values) > most
    if not beyond.any():
        return None
    j = int(np.argmax(beyond))
    return f"expected a {what} of {names[j]} up to {most[j]:.4g}, got {values[j]:.4g}"


class TrackingGuard:
    """Distance from the commanded position: `TRACKING` of the range, at most `WIDEST`."""

    name = "tracking"

    def __init__(self, lib: Library) -> None:
        self._names = lib.joint_names
        limits = lib.limits()
        self._most = np.minimum(TRACKING * (limits["upper"] - limits["lower"]), WIDEST)

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on the first joint that is too far away."""
        away = np.abs(sample.q - reference.q)
        if (away <= self._most).all():
            return None
        j = int(np.argmax(away / self._most))
        return (
            f"expected {self._names[j]} within {self._most[j]:.3g} of its command, it is "
            f"{away[j]:.3g} away"
        )


class ExternalTorqueGuard:
    """External torque on one joint, by the momentum observer of a model, else of the URDF's bodies.

        r ~ N(0, Σ),  Σ = σ_a² M² + diag(e²),   r̂_j = (Σ⁻¹ r)_j / (Σ⁻¹)_jj,   σ_j² = 1 / (Σ⁻¹)_jj

    Noise of the speeds enters r through M, so that it is correlated between joints: r̂_j, a torque
    on joint j alone given the r of all joints, has a fraction of the noise of r_j.
    """

    name = "external torque"

    def __init__(self, lib: Library, rate_hz: float, model: SavedResult | None = None) -> None:
        self._lib = lib
        known = urdf_model(lib) if model is None else model
        self._pi = lib.pi0 if model is None else model.pi
        window = max(WINDOW, 2 / rate_hz)
        self._observer = Observer(lib, known, rate_hz=rate_hz, bandwidth=BANDWIDTH, window_s=window)
        self._variance = np.diag(model_error(lib) ** 2)  # e²

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on the joint with the largest external torque above its threshold."""
        r = self._observer.update(sample.q, sample.dq, sample.tau)
        mass = ACCELERATION_NOISE * self._lib.mass_matrix(sample.q, self._pi)
        precision = np.linalg.inv(mass @ mass + self._variance)
        weight = np.diag(precision)
        torque, most = precision @ r / weight, LEVEL / np.sqrt(weight)
        if (np.abs(torque) <= most).all():
            return None
        j = int(np.argmax(np.abs(torque) / most))
        return (
            f"expected an external torque of {self._lib.joint_names[j]} up to {most[j]:.3g}, got "
            f"{torque[j]:+.3g}"
        )


class ClockGuard:
    """Age of the data and regularity of the robot's clock; `late` in periods between samples."""

    name = "clock"

    def __init__(self, rate_hz: float, late: float = LATE) -> None:
        self._period, self._late = 1 / rate_hz, late
        self._before: Sample | None = None

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on a sample that is late, repeated or stamped with another time."""
        before, self._before = self._before, sample
        if before is None:
            return None
        step, waited = sample.t - before.t, sample.arrived - before.arrived
        most = self._late * self._period
        if not step > 0:
            return (
                f"expected a newer sample, its clock went from {before.t:.4f} to {sample.t:.4f} s"
            )
        if step > most:
            return f"expected a sample every {self._period:g} s, its clock jumped by {step:.4f} s"
        if waited > most:
            return f"expected a sample every {self._period:g} s, it came after {waited:.4f} s"
        return None


class KeyGuard:
    """A key of the user; `pressed` returns True once the user wants to stop."""

    name = "key"

    def __init__(self, pressed: Callable[[], bool]) -> None:
        self._pressed = pressed

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on the key."""
        return "the user pressed the key to stop" if self._pressed() else None


def usual_guards(lib: Library, rate_hz: float, model: SavedResult | None = None) -> Sequence[Guard]:
    """Guards of a robot with their usual settings, fresh for one motion."""
    external = ExternalTorqueGuard(lib, rate_hz, model)
    return [ClockGuard(rate_hz), LimitsGuard(lib), TrackingGuard(lib), external]


def model_error(lib: Library) -> Array:
    """σ of the modelled torque of an arm that is not identified yet, (n,) [N·m, N]."""
    effort = lib.limits()["effort"]
    bounded = np.isfinite(effort) & (effort > 0)
    if not bounded.all():
        j = int(np.argmin(bounded))
        raise IdentificationError(
            f"expected an effort limit of {lib.joint_names[j]} for the guard of the external "
            "torque; state it in the URDF, or as effort under [[link]] of a TOML file"
        )
    low, high, least = MODEL_ERROR
    return np.asarray(np.minimum(high * effort, np.maximum(low * effort, least)))
