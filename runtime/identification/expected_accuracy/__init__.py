"""What a motion will tell of a robot, and what recording more of it would still improve."""

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
    Worth,
    gained,
    verdict,
)
from runtime.identification.expected_accuracy.growth import Growth, growth
from runtime.identification.expected_accuracy.planned_samples import (
    Moved,
    Noise,
    moved_of,
    noise_of,
    planned,
)

__all__ = [
    "SECONDS",
    "WORTHWHILE",
    "Expected",
    "Growth",
    "Knowledge",
    "Moved",
    "Noise",
    "Worth",
    "base_names",
    "expected",
    "facts",
    "gained",
    "growth",
    "moved_of",
    "noise_of",
    "planned",
    "verdict",
]
