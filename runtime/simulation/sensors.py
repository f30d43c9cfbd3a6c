"""Sensors of a virtual robot.

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
    """Gain and bias of the torque sensors of one robot, (n,) each."""

    gain: Array
    bias: Array


def calibration(sensors: Sensors, rng: np.random.Generator) -> Calibration:
    """Draw the calibration of one robot."""
    n = len(sensors.torque_gain)
    gain = 1 + sensors.torque_gain * rng.normal(size=n)
    return Calibration(gain, sensors.torque_bias * rng.normal(size=n))


def quantised(values: Array, quantum: Array) -> Array:
    """Values on the grid of a quantum."""
    step = np.where(quantum > 0, quantum, 1.0)
    return np.where(quantum > 0, np.round(values / step) * step, values)


def measured_torque(
    link: Array, sensors: Sensors, of: Calibration, rng: np.random.Generator
) -> Array:
    """Measured torque τ̂.

    link (N, n) → (N, n).
    """
    noise = sensors.torque_noise * rng.normal(size=link.shape)
    return quantised(of.gain * link + of.bias + noise, sensors.torque_quantum)


class Encoders:
    """Measured q̂ and dq̂ period by period, for the controller and the log."""

    def __init__(self, sensors: Sensors, noise: Array, period: float, places: Array) -> None:
        """Encoders before the first period."""
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
        """Measured state of a period from the true one; before the first one dq̂ is true.

        q (n,), dq (n,) → (n,).
        """
        raw = q + self._noise[k]
        measured = np.rint(raw * self._inverse) * self._quantum
        if self._any_exact:
            measured = np.where(self._exact, raw, measured)
        if self._before is None:
            self._speed = dq.copy()
        else:
            self._speed = self._keep * self._speed + self._share * (measured - self._before)
        self._before = measured
        return measured, self._speed
