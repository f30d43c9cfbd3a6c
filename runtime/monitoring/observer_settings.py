"""Settings of the observer of external torque: rate, bandwidth, window, source of the speed."""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array

BANDWIDTH = 100.0
"""K_O of the observer unless it is stated [1/s]."""
VELOCITIES = ("measured", "position")


@dataclass(frozen=True, slots=True)
class ObserverSettings:
    """Discrete observer.

    Attributes:
        rate_hz: rate of the samples [Hz].
        bandwidth: K_O [1/s].
        steps: length of the averaging window in steps of time, 0 for none.
        velocity: "measured" takes dq, "position" the difference of q over the window.
    """

    rate_hz: float
    bandwidth: float = BANDWIDTH
    steps: int = 0
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
