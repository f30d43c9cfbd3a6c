"""Expected standard deviations of a planned or recorded motion, and the gain of recording more."""

from runtime.identification.expected_accuracy.expected import (
    Expected,
    Knowledge,
    base_names,
    expected,
    facts,
)
from runtime.identification.expected_accuracy.gain_of_recording import (
    SECONDS,
    WORTHWHILE,
    GainOfRecording,
    gained,
    verdict,
)
from runtime.identification.expected_accuracy.growth import Growth, growth
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    Noise,
    motion_samples_of,
    noise_of,
    planned_recording,
)
from runtime.identification.expected_accuracy.same_motion import gained_by_same_motion
from runtime.identification.expected_accuracy.torque_gains import gain_slopes, torque_of_gains

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
