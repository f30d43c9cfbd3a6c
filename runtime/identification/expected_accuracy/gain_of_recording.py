"""Gain of recording more: σ after further seconds over σ now, by name.

    gain = 1 − σ_after / σ_now

The same motion again adds information at the same rate: information grows in proportion to time,
and σ of parameters that the data determine decreases like 1/√t. Another motion has another rate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

WORTHWHILE = 0.10
"""Gain above which further recording is recommended."""
SECONDS = (10.0, 30.0, 60.0)
"""Further recording times that are evaluated by default, s."""
PAYLOAD_MASS = "payload mass"
"""Name that is listed first where it gains."""
_NAMED = 3
"""Number of names in a sentence."""


@dataclass(frozen=True, slots=True)
class GainOfRecording:
    """Gain of some more seconds of recording.

    Attributes:
        seconds: further recording time, s.
        motion: "the same motion", or the name of another one.
        gains: name → 1 − σ_after/σ_now; 0 is no gain, 1 is exact knowledge; the largest first.
    """

    seconds: float
    motion: str
    gains: Mapping[str, float]

    @property
    def gaining(self) -> tuple[str, ...]:
        """Names whose gain exceeds `WORTHWHILE`."""
        return tuple(name for name, gain in self.gains.items() if gain > WORTHWHILE)

    @property
    def sentence(self) -> str:
        """One sentence on the values that improve, and by how much."""
        if not self.gaining:
            name, gain = next(iter(self.gains.items()))
            return (
                f"{self.seconds:g} s more of {self.motion} improve no value by "
                f"{_percent(WORTHWHILE)} % (most: {name} by {_percent(gain)} %)"
            )
        first = sorted(self.gaining, key=lambda name: name != PAYLOAD_MASS)[:_NAMED]
        named = [f"{name} by {_percent(self.gains[name])} %" for name in first]
        rest = len(self.gaining) - len(named)
        if rest:
            more = f"{rest} more of {len(self.gains)} numbers"
            named.append(f"{more} by over {_percent(WORTHWHILE)} %")
        return f"{self.seconds:g} s more of {self.motion} improve {_listed(named)}"


def gained(
    now: Mapping[str, float], later: Mapping[str, float], seconds: float, motion: str
) -> GainOfRecording:
    """Gains between two sets of standard deviations.

    Args:
        now: name → σ.
        later: name → σ after the further recording.
        seconds: further recording time, s.
        motion: "the same motion", or a name.

    Returns:
        The gains; 1 for a name that `now` lacks, because the data did not determine it.
    """
    gains = {name: 1.0 - after / now[name] if name in now else 1.0 for name, after in later.items()}
    # Gains that differ by rounding keep the order of the names.
    order = sorted(gains, key=lambda name: -round(gains[name], 3))
    return GainOfRecording(seconds, motion, {name: gains[name] for name in order})


def verdict(gains: Sequence[GainOfRecording]) -> str:
    """One sentence on the shortest time with a gain, else on the longest: go on, or stop."""
    in_time = sorted(gains, key=lambda gain: gain.seconds)
    best = next((gain for gain in in_time if gain.gaining), in_time[-1])
    return f"{best.sentence}: {'go on' if best.gaining else 'stop'}"


def _percent(gain: float) -> str:
    return f"{100 * gain:.0f}"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
