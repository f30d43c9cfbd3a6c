"""How σ falls while a motion is recorded."""

from dataclasses import dataclass

import numpy as np

from runtime.identification.expected_accuracy.expected import Knowledge, expected
from runtime.identification.expected_accuracy.planned_samples import MotionSamples
from runtime.library import Array, Library
from runtime.library.parameters import links, mass

KNOTS = 24
"""Instants, closer together in the beginning, where most is learned."""
SOONEST = 0.02
"""Share of the motion at which the first one lies."""


@dataclass(frozen=True, slots=True)
class Growth:
    """Standard deviations over recording time.

    Attributes:
        robot, motion: names.
        links: names of the bodies.
        seconds: (k,).
        recorded: s of the motion itself; what is later is `further`.
        further: what follows, "the same motion" or a name.
        masses: σ by MAP, (k, n) kg.
        worst: largest relative σ of a base parameter by MAP, (k,).
        worst_name: which one it is in the end.
        payload: σ of a payload's mass, (k,) kg, infinite as long as nothing is told of it.
    """

    robot: str
    motion: str
    links: tuple[str, ...]
    seconds: Array
    recorded: float
    further: str
    masses: Array
    worst: Array
    worst_name: str
    payload: Array


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
    """σ at instants of the motion, and `until` s after its end with more of this or another one."""
    length = moved.seconds
    within = np.geomspace(SOONEST * length, length, KNOTS)
    beyond = length + np.linspace(0.0, until, KNOTS // 2 + 1)[1:] if until else np.zeros(0)
    whole = moved.statistics(lib, noise)
    found = []
    for now in (*within, *beyond):
        if now <= length:
            told = moved.statistics(lib, noise, now)
        else:
            told = whole.merged((more or moved).statistics(lib, noise, now - length))
        found.append(expected(lib, told, known, unit, moved.columns))
    last = int(np.argmax(found[-1].relative))
    return Growth(
        robot=lib.name,
        motion=moved.name,
        links=lib.link_names,
        seconds=np.concatenate([within, beyond]),
        recorded=length,
        further=more.name if more is not None else "the same motion",
        masses=np.array([mass(links(one.pi)) for one in found]),
        worst=np.array([one.relative.max() for one in found]),
        worst_name=names[last],
        payload=np.array(
            [np.inf if one.payload is None else float(mass(one.payload)) for one in found]
        ),
    )
