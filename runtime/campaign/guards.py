"""Guards: what every sample of a motion must fulfil, else the robot stops.

| guard | refuses |
|---|---|
| `LimitsGuard` of `limits_guard` | limits of joints exceeded, numbers that are not finite |
| `TrackingGuard` | a position far from the commanded one |
| `ExternalTorqueGuard` | an external torque above a threshold, by the momentum observer |
| `ClockGuard` | late or repeated samples, a clock that jumps |
| `KeyGuard` | a key of the user |
"""

from collections.abc import Callable, Sequence

import numpy as np

from runtime.campaign.driver import Guard, Reference, Sample
from runtime.campaign.guard_model import model_error, urdf_model
from runtime.campaign.limits_guard import LimitsGuard
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.monitoring.observer import Observer

TRACKING = 0.02
"""Largest distance from the commanded position, as a share of the range of a joint."""
WIDEST = 0.05
"""Upper bound of that distance [rad, m]."""
BANDWIDTH = 1000.0
WINDOW = 0.003
"""Bandwidth [1/s] and averaging window [s] of the observer: it shows 96 % of a step after 5 ms."""
ACCELERATION_NOISE = 1.0
"""σ of M⁻¹ r by the noise of the speeds at that bandwidth [rad/s², m/s²]; encoders of 10 µrad."""
LEVEL = 5.0
"""Standard deviations from which an external torque stops the robot; a virtual FR3 at full speed
reached 4.2 in 30 s of free motion."""
LATE = 3.0
"""Periods without a sample after which data are stale; a jump of the robot's clock alike."""


class TrackingGuard:
    """Distance from the commanded position.

    Args:
        lib: library of the robot.
        most: (n,) or one number [rad, m]; None: `TRACKING` of the range, at most `WIDEST`.
    """

    name = "tracking"

    def __init__(self, lib: Library, most: Array | float | None = None) -> None:
        self._names = lib.joint_names
        limits = lib.limits()
        usual = np.minimum(TRACKING * (limits["upper"] - limits["lower"]), WIDEST)
        self._most = np.broadcast_to(usual if most is None else most, lib.n_joints)

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
    """External torque on one joint, by the momentum observer.

        r ~ N(0, Σ),  Σ = σ_a² M² + diag(e²),   r̂_j = (Σ⁻¹ r)_j / (Σ⁻¹)_jj,   σ_j² = 1 / (Σ⁻¹)_jj

    Noise of the speeds enters r through M, so that it is correlated between joints: r̂_j, a torque
    on joint j alone given the r of all joints, has a fraction of the noise of r_j.

    Args:
        lib: library of the robot.
        rate_hz: of the samples [Hz].
        model: identified model; None: the bodies of the URDF without friction.
        error: e (n,), σ of the modelled torque [N·m, N]; None: that of `model_error`.
    """

    name = "external torque"

    def __init__(
        self,
        lib: Library,
        rate_hz: float,
        model: SavedResult | None = None,
        error: Array | None = None,
    ) -> None:
        self._lib = lib
        known = urdf_model(lib) if model is None else model
        self._pi = known.pi
        window = max(WINDOW, 2 / rate_hz)
        self._observer = Observer(lib, known, rate_hz=rate_hz, bandwidth=BANDWIDTH, window_s=window)
        usual = model_error(lib) if error is None else np.asarray(error, dtype=float)
        self._variance = np.diag(usual**2)

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
    """Age of the data and regularity of the robot's clock.

    Args:
        rate_hz: of the samples [Hz].
        late: periods between two samples at most.
    """

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
    """A key of the user.

    Args:
        pressed: returns True once the user wants to stop.
    """

    name = "key"

    def __init__(self, pressed: Callable[[], bool]) -> None:
        self._pressed = pressed

    def refusal(self, sample: Sample, reference: Reference) -> str | None:
        """Sentence on the key."""
        return "the user pressed the key to stop" if self._pressed() else None


def usual_guards(
    lib: Library,
    rate_hz: float,
    model: SavedResult | None = None,
    pressed: Callable[[], bool] | None = None,
) -> Sequence[Guard]:
    """All guards with their usual settings, fresh for one motion."""
    guards: list[Guard] = [ClockGuard(rate_hz), LimitsGuard(lib), TrackingGuard(lib)]
    if pressed is not None:
        guards.append(KeyGuard(pressed))
    return [*guards, ExternalTorqueGuard(lib, rate_hz, model)]
