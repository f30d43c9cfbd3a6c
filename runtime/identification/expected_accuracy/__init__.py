"""Expected standard deviations of a planned or recorded motion, and the gain of recording more."""

from runtime.identification.expected_accuracy.expected import (
    Expected,
    Knowledge,
    base_names,
    expected,
    facts,
    gain_slopes,
    torque_of_gains,
)
from runtime.identification.expected_accuracy.growth import (
    SECONDS,
    WORTHWHILE,
    GainOfRecording,
    Growth,
    gained,
    gained_by_same_motion,
    growth,
    verdict,
)
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    Noise,
    motion_samples_of,
    noise_of,
    planned_recording,
)

__all__ = [
    "SECONDS",
    "WORTHWHILE",
    "Expected",
    "GainOfRecording",
    "Growth",
    "Knowledge",
    "MotionSamples",
    "Noise",
    "base_names",
    "expected",
    "facts",
    "gain_slopes",
    "gained",
    "gained_by_same_motion",
    "growth",
    "motion_samples_of",
    "noise_of",
    "planned_recording",
    "torque_of_gains",
    "verdict",
]
