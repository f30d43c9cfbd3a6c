"""Digital filters as second-order sections, by `scipy.signal`, imported when the first one runs.

Its import takes half of the time of a command that may not filter at all.
"""

from types import ModuleType

import numpy as np

from runtime.recording.recording import FloatArray


def _signal() -> ModuleType:
    from scipy import signal

    return signal


def butterworth_sections(order: int, cutoff: float) -> FloatArray:
    """Sections (s, 6) of a Butterworth low-pass; the cut-off is a share of half the rate."""
    return np.asarray(_signal().butter(order, cutoff, output="sos"))


def steady_state(sections: FloatArray) -> FloatArray:
    """State (s, 2) of every section behind an input that is 1 for ever."""
    return np.asarray(_signal().sosfilt_zi(sections))


def run_sections(
    sections: FloatArray, values: FloatArray, state: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Filter columns (N, m) from a state (s, 2, m) on; return the output and the state after it."""
    filtered, after = _signal().sosfilt(sections, values, axis=0, zi=state)
    return filtered, after


def both_directions(sections: FloatArray, values: FloatArray, padding: int) -> FloatArray:
    """Filter columns (N, m) forwards and backwards, extended oddly at both ends."""
    return np.asarray(_signal().sosfiltfilt(sections, values, axis=0, padlen=padding))


def squared_gain(sections: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Frequencies, evenly from 0 to half the rate [rad per sample], and |H|² there."""
    frequency, gain = _signal().freqz_sos(sections, count)
    return frequency, np.abs(gain) ** 2
