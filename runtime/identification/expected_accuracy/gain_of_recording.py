"""Is it worth while to record more? σ now against σ after some more seconds, by name.

    gain = 1 − σ_after / σ_now

The same motion again adds as much information per second as it has so far: information grows in
proportion to time, and σ of what the data decide falls like 1/√t. Another motion adds its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

WORTHWHILE = 0.10
"""Gain above which more recording is worth while."""
SECONDS = (10.0, 30.0, 60.0)
"""Asked for by default."""
PAYLOAD_MASS = "payload mass"
"""Told first where it gains."""
_NAMED = 3


@dataclass(frozen=True, slots=True)
class GainOfRecording:
    """What some more seconds bring.

    Attributes:
        seconds: of recording.
        motion: what is recorded, "the same motion" or a name.
        gains: by name, 0 is nothing and 1 perfect knowledge; the largest first.
    """

    seconds: float
    motion: str
    gains: Mapping[str, float]

    @property
    def gaining(self) -> tuple[str, ...]:
        """Names of what gains more than `WORTHWHILE`."""
        return tuple(name for name, gain in self.gains.items() if gain > WORTHWHILE)

    @property
    def sentence(self) -> str:
        """What improves, and by how much."""
        if not self.gaining:
            name, gain = next(iter(self.gains.items()))
            return (
                f"{self.seconds:g} s more of {self.motion} improve nothing by "
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
    """Gains by name; what is told only later has gained all."""
    gains = {name: 1.0 - after / now[name] if name in now else 1.0 for name, after in later.items()}
    # Gains that differ by rounding keep the order of the names.
    order = sorted(gains, key=lambda name: -round(gains[name], 3))
    return GainOfRecording(seconds, motion, {name: gains[name] for name in order})


def verdict(worths: Sequence[GainOfRecording]) -> str:
    """One sentence on the shortest that is worth while, else on the longest: go on, or stop."""
    in_time = sorted(worths, key=lambda worth: worth.seconds)
    best = next((worth for worth in in_time if worth.gaining), in_time[-1])
    return f"{best.sentence}: {'go on' if best.gaining else 'stop'}"


def _percent(gain: float) -> str:
    return f"{100 * gain:.0f}"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
