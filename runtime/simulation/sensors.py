"""What the sensors of a virtual robot tell.

    q̂ = round((q + e) / Δ) Δ     dq̂: its differences over a period, through a low-pass of order one
    τ̂ = round((g τ + b + e) / Δ) Δ      τ behind the rotor: friction is in it, J ddq is not

A robot has a gain g = 1 + N(0, gain²) and a bias b = N(0, bias²) per joint for good; the noise e
is drawn for every log.
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array
from runtime.simulation.settings import Sensors


@dataclass(frozen=True, slots=True)
class Calibration:
    """Of the torque sensors of one robot, (n,) each: what its maker got wrong."""

    gain: Array
    bias: Array


def calibration(sensors: Sensors, rng: np.random.Generator) -> Calibration:
    """Draw that of one robot."""
    n = len(sensors.torque_gain)
    gain = 1 + sensors.torque_gain * rng.normal(size=n)
    return Calibration(gain, sensors.torque_bias * rng.normal(size=n))


def quantised(values: Array, quantum: Array) -> Array:
    """Values (…, n) on the grid of the quantum (n,); where it is 0 they stay as they are."""
    step = np.where(quantum > 0, quantum, 1.0)
    return np.where(quantum > 0, np.round(values / step) * step, values)


def measured_torque(
    link: Array, sensors: Sensors, of: Calibration, rng: np.random.Generator
) -> Array:
    """τ̂ (N, n) of the torque behind the rotors (N, n)."""
    noise = sensors.torque_noise * rng.normal(size=link.shape)
    return quantised(of.gain * link + of.bias + noise, sensors.torque_quantum)


class Encoders:
    """q̂ and dq̂, period by period, as the controller gets them and the log keeps them."""

    def __init__(self, sensors: Sensors, noise: Array, period: float, places: Array) -> None:
        """With the noise (N, n) of a log in the order of `places`."""
        order = np.argsort(places)
        self._noise = noise
        quantum = sensors.position_quantum[order]
        self._inverse = 1 / np.where(quantum > 0, quantum, 1.0)
        self._quantum = np.where(quantum > 0, quantum, 0.0)
        self._exact = quantum <= 0
        self._any_exact = bool(self._exact.any())
        self._keep = np.exp(-2 * np.pi * sensors.velocity_cutoff_hz[order] * period)
        self._share = (1 - self._keep) / period
        self._before: Array | None = None
        self._speed = np.zeros(len(order))

    def read(self, k: int, q: Array, dq: Array) -> tuple[Array, Array]:
        """q̂ and dq̂ of period k from the true state; before the first one dq̂ is true."""
        raw = q + self._noise[k]
        told = np.rint(raw * self._inverse) * self._quantum
        if self._any_exact:
            told = np.where(self._exact, raw, told)
        if self._before is None:
            self._speed = dq.copy()
        else:
            self._speed = self._keep * self._speed + self._share * (told - self._before)
        self._before = told
        return told, self._speed
