"""Lag of sensors that pass a first-order low-pass: all other signals pass the same one.

    H(s) = 1 / (1 + s / (2 π f))

Drivers of force sensors often contain such a filter. A linear relation between forces and the other
signals survives if these signals pass it, too; the inverse filter would amplify the noise of the
forces instead. Forwards only, unlike the zero-phase filters of `filters`.
"""

import numpy as np

from runtime.errors import RecordingError
from runtime.recording.preprocessing.sections import (
    butterworth_sections,
    run_sections,
    steady_state,
)
from runtime.recording.preprocessing.segments import segments, uniform_step
from runtime.recording.recording import FloatArray, Recording


def lagged(recording: Recording, values: FloatArray, cutoff_hz: float) -> FloatArray:
    """First-order low-pass of signals, from rest at the start of every segment.

    values (N, m) → (N, m).
    """
    step = uniform_step(recording, "delay")
    if not cutoff_hz * step < 0.499:
        raise RecordingError(
            f"{recording.name}: contact_force_z_cutoff is {cutoff_hz:g} Hz, expected a value below "
            f"{0.5 / step:.4g} Hz (half the rate); correct it, or remove it where the sensors have "
            "no such low-pass"
        )
    sections = butterworth_sections(1, 2.0 * cutoff_hz * step)
    still = steady_state(sections)[:, :, None]
    parts = [
        run_sections(sections, values[part], still * values[part][0])[0]
        for part in segments(recording.t)
    ]
    return np.concatenate(parts)
