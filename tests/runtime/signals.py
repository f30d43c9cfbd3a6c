"""Signals known in closed form, for tests of preprocessing."""

import numpy as np

from runtime.recording import Recording


def sine(hz: float, rate: float = 1000.0, seconds: float = 4.0, **more) -> Recording:
    t = np.arange(round(rate * seconds)) / rate
    w = 2 * np.pi * hz
    q = np.stack([np.sin(w * t), np.cos(w * t)], axis=1)
    dq = w * np.stack([np.cos(w * t), -np.sin(w * t)], axis=1)
    return Recording(t=t, q=q, dq=dq, **more)


def with_hole(recording: Recording, first: float, last: float) -> Recording:
    keep = (recording.t < first) | (recording.t >= last)
    return recording.take(keep, "Cut a hole.")


def middle(recording: Recording, seconds: float = 1.0) -> np.ndarray:
    t = recording.t
    return (t > t[0] + seconds) & (t < t[-1] - seconds)
