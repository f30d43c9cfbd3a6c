"""What a motion will tell of a robot, and what recording more of it would still improve."""

from runtime.accuracy.expected import Expected, Knowledge, base_names, expected, facts
from runtime.accuracy.growth import Growth, growth
from runtime.accuracy.motion import Moved, Noise, moved_of, noise_of, planned
from runtime.accuracy.worth import SECONDS, WORTHWHILE, Worth, gained, verdict

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
