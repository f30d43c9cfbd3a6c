"""Standard deviations over the recording time of a motion, and the gain of recording more.

    gain = 1 − σ_after / σ_now

The same motion again adds information at the same rate: information grows in proportion to time,
and σ of parameters that the data determine decreases like 1/√t. Another motion has another rate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.estimators.convex.eliminate_friction import reduce
from runtime.estimators.regression.factor import Statistics
from runtime.identification.expected_accuracy.expected import PAYLOAD_MASS, Knowledge, expected
from runtime.identification.expected_accuracy.planned_samples import MotionSamples
from runtime.library import Array, Library
from runtime.library.parameters import links, mass

WORTHWHILE = 0.10
"""Gain above which further recording is recommended."""
SECONDS = (10.0, 30.0, 60.0)
"""Further recording times that are evaluated by default, s."""
_NAMED = 3
"""Number of names in a sentence."""
KNOTS = 24
"""Number of instants; they are closer together at the beginning, where σ decreases fastest."""
SOONEST = 0.02
"""First instant, as a share of the motion."""


@dataclass(frozen=True, slots=True)
class GainOfRecording:
    """Gain of some more seconds of recording."""

    seconds: float  # further recording time, s
    motion: str  # "the same motion", or the name of another one
    # name → 1 − σ_after/σ_now; 0 is no gain, 1 is exact knowledge; the largest first
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
    """Gains between two sets of standard deviations."""
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


def gained_by_same_motion(
    lib: Library, statistics: Statistics, known: Knowledge, grown: float, seconds: float
) -> GainOfRecording:
    """Gain of further samples of the same motion."""
    unit = max(reduce(statistics, lib.n_joints)[0].variance, np.finfo(float).tiny)
    now, later = (expected(lib, statistics, known, u).by_name(lib) for u in (unit, unit / grown))
    return gained(now, later, seconds, "the same motion")


@dataclass(frozen=True, slots=True)
class Growth:
    """Standard deviations over recording time."""

    robot: str  # name of the robot
    motion: str  # name of the motion
    links: tuple[str, ...]  # names of the links
    seconds: Array  # recording times, (k,) s
    recorded: float  # duration of the motion itself, s; later instants belong to `further`
    further: str  # "the same motion", or the name of the one that follows
    masses: Array  # σ of the link masses by MAP, (k, n) kg
    worst: Array  # largest relative σ of a base parameter by MAP, (k,)
    worst_name: str  # name of that base parameter at the end
    payload: Array  # σ of the mass of a payload, (k,) kg; infinite while it is not determined


def growth(
    lib: Library,
    moved: MotionSamples,
    noise: Array,
    known: Knowledge,
    unit: float,
    names: tuple[str, ...],
    *,
    more: MotionSamples | None = None,
    until: float = 0.0,
) -> Growth:
    """Standard deviations at instants of a motion and after its end.

    noise (n,) N·m or N.
    """
    length = moved.seconds
    within = np.geomspace(SOONEST * length, length, KNOTS)
    beyond = length + np.linspace(0.0, until, KNOTS // 2 + 1)[1:] if until else np.zeros(0)
    whole = moved.statistics(lib, noise)
    sigmas = []
    for now in (*within, *beyond):
        if now <= length:
            statistics = moved.statistics(lib, noise, now)
        else:
            statistics = whole.merged((more or moved).statistics(lib, noise, now - length))
        sigmas.append(expected(lib, statistics, known, unit, moved.columns))
    last = int(np.argmax(sigmas[-1].relative))
    return Growth(
        robot=lib.name,
        motion=moved.name,
        links=lib.link_names,
        seconds=np.concatenate([within, beyond]),
        recorded=length,
        further=more.name if more is not None else "the same motion",
        masses=np.array([mass(links(one.pi)) for one in sigmas]),
        worst=np.array([one.relative.max() for one in sigmas]),
        worst_name=names[last],
        payload=np.array(
            [np.inf if one.payload is None else float(mass(one.payload)) for one in sigmas]
        ),
    )
