"""Standard deviations over the recording time of a motion."""

from dataclasses import dataclass

import numpy as np

from runtime.identification.expected_accuracy.expected import Knowledge, expected
from runtime.identification.expected_accuracy.planned_samples import MotionSamples
from runtime.library import Array, Library
from runtime.library.parameters import links, mass

KNOTS = 24
"""Number of instants; they are closer together at the beginning, where σ decreases fastest."""
SOONEST = 0.02
"""First instant, as a share of the motion."""


@dataclass(frozen=True, slots=True)
class Growth:
    """Standard deviations over recording time.

    Attributes:
        robot: name of the robot.
        motion: name of the motion.
        links: names of the links.
        seconds: recording times, (k,) s.
        recorded: duration of the motion itself, s; later instants belong to `further`.
        further: "the same motion", or the name of the one that follows.
        masses: σ of the link masses by MAP, (k, n) kg.
        worst: largest relative σ of a base parameter by MAP, (k,).
        worst_name: name of that base parameter at the end.
        payload: σ of the mass of a payload, (k,) kg; infinite while it is not determined.
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
    """Standard deviations at instants of a motion and after its end.

    Args:
        lib: library of the robot.
        moved: samples of the motion.
        noise: σ of the torque, (n,) N·m or N.
        known: knowledge before the motion.
        unit: u, the variance of a weighted row with its inflation.
        names: names of the base parameters.
        more: motion that follows; None repeats the same one.
        until: time after the end of the motion, s.

    Returns:
        σ over time.
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
