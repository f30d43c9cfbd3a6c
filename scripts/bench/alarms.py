"""How often `identify` names a fault of a log, and how often it names one where there is none.

Every trial draws robot, motion and torque noise from its number alone. The advice of the result is
read as a user reads it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from bench.coverage import FILTERED, LINK, RHO, TERMS
from runtime import Recording, identify
from runtime.estimators.uncertainty import Uncertainty
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.library.parameters import links
from runtime.simulation import Plant, ideal
from runtime.simulation.box_payload import Box
from runtime.simulation.virtual_robot import perturbed

Array = NDArray[np.float64]

NOISE, VISCOUS, COULOMB = 0.05, 0.5, 0.3
"""Standard deviation of the torque noise [N·m] and friction of every joint [N·m·s, N·m]."""
SPREAD = 0.1
"""Spread of the robots about the URDF."""
GAIN = 1.1
LATE = 0.3
"""Delay of the torque in rows of 10 ms."""
PEAK, WIDTH = 1.0, 0.1
"""Stribeck peak [N·m] and its speed [rad/s]."""


@dataclass(frozen=True, slots=True)
class Log:
    """How the motions of a case are logged."""

    label: str  # of a table
    is_long: bool = False  # the 20 s motion of `excite`, not the 10 s ones
    repetitions: int = 1  # of the motion
    rate_hz: float = 100.0  # rows per second
    rho: float = 0.0  # correlation of the noise over a hundredth of a second


SHORT = Log("10 s at 100 Hz")
COLOURED = Log("10 s at 100 Hz, coloured noise", rho=RHO)
LONG = Log("3 × 20 s at 1 kHz", True, 3, 1000.0)
LOGS = (
    SHORT,
    Log("20 s at 100 Hz", True),
    Log("3 × 20 s at 100 Hz", True, 3),
    Log("6 × 20 s at 100 Hz", True, 6),
    Log("20 s at 1 kHz", True, 1, 1000.0),
    LONG,
)
"""Logs for which the smallest gain error that is named is measured."""
POWERS = (0.05, 0.1, 0.2, 0.4)
"""Errors of the gain."""
WRIST = 6
"""Index of the joint whose torque is mostly friction."""


@dataclass(frozen=True, slots=True)
class Case:
    """A fault and the words by which the advice names it."""

    label: str  # row of the table
    words: tuple[str, ...]  # one of these is in an advice that names the fault
    robot: Callable[[Library, np.random.Generator], Array]  # π of the URDF → of the arm
    torque: Callable[[Array, Array], Array] = lambda tau, _: tau  # τ, dq → τ as logged
    log: Log = SHORT
    limit: str = "\n"  # words of an advice which states that the log cannot show the fault


def _usual(lib: Library, rng: np.random.Generator) -> Array:
    return perturbed(lib, lib.pi0, SPREAD, rng)


def _loaded(kilograms: float) -> Callable[[Library, np.random.Generator], Array]:
    def robot(lib: Library, rng: np.random.Generator) -> Array:
        place = (*(0.02 * rng.normal(size=2)), 0.15)
        return _usual(lib, rng) + Box(kilograms, place, (0.1, 0.08, 0.06), LINK).pi(lib)

    return robot


def _foreign(lib: Library, rng: np.random.Generator) -> Array:
    """Bodies of the links in reverse order: another arm with the same joints."""
    return links(_usual(lib, rng))[::-1].ravel()


def _gain(joint: int, gain: float = GAIN) -> Callable[[Array, Array], Array]:
    def torque(tau: Array, _: Array) -> Array:
        return tau * np.where(np.arange(tau.shape[1]) == joint, gain, 1.0)

    return torque


def _peak(tau: Array, dq: Array) -> Array:
    return np.asarray(tau + PEAK * np.exp(-np.abs(dq) / WIDTH) * np.sign(dq))


def _late(tau: Array, _: Array) -> Array:
    rows = np.arange(len(tau))
    return np.stack([np.interp(rows - LATE, rows, column) for column in tau.T], axis=1)


ALARM = ("do not trust", "too narrow")
CASES = (
    Case("none", ALARM, _usual),
    Case(f"none, {COLOURED.label}", ALARM, _usual, log=COLOURED),
    Case(f"none, {LONG.label}", ALARM, _usual, log=LONG),
    *(
        Case(f"unknown payload of {mass:g} kg", ("the URDF is wrong",), _loaded(mass))
        for mass in (0.5, 1.0, 3.0)
    ),
    *(
        Case(
            f"torque gain of joint {k + 1} 10 % off",
            (f"at fr3_joint{k + 1},",),
            _usual,
            _gain(k),
            limit=f"fr3_joint{k + 1} (",
        )
        for k in range(7)
    ),
    Case(
        f"torque gain of joint {WRIST + 1} 10 % off, {LONG.label}",
        (f"at fr3_joint{WRIST + 1},",),
        _usual,
        _gain(WRIST),
        log=LONG,
        limit=f"fr3_joint{WRIST + 1} (",
    ),
    Case("torque in mN·m", ("the unit or sign",), _usual, lambda tau, _: 1e3 * tau),
    Case("bodies of another arm", ("contradict the inert",), _foreign),
    Case("Stribeck friction without a column", ("contain friction",), _usual, _peak),
    Case("torque 3 ms late", ("ms too late",), _usual, _late),
)


def alarms(
    lib: Library, designs: list[Trajectory], long: Trajectory, count: int
) -> Iterator[tuple[str, int, int, int]]:
    """Identify `count` logs of every case."""
    for case in CASES:
        motions = [long] if case.log.is_long else designs
        words = [_advice(lib, motions[k % len(motions)], case, k) for k in range(count)]
        named = sum(any(each in text for each in case.words) for text in words)
        doubted = sum(any(each in text for each in ALARM) for text in words)
        yield case.label, named, sum(case.limit in text for text in words), doubted


def powers(
    lib: Library, designs: list[Trajectory], long: Trajectory, count: int
) -> Iterator[tuple[str, float, list[int]]]:
    """Identify logs with a wrong gain of `WRIST`, by length and rate of the log."""
    for log in LOGS:
        motions = [long] if log.is_long else designs
        limits, named = [], [0] * len(POWERS)
        for seed in range(count):
            motion = motions[seed % len(motions)]
            clean = _identified(lib, motion, Case("", (), _usual, log=log), seed)
            limits.append(float(clean.tests.gain_limits[WRIST]))
            for k, error in enumerate(POWERS):
                case = Case("", (), _usual, _gain(WRIST, 1 + error), log)
                text = _advice(lib, motion, case, seed)
                named[k] += f"at fr3_joint{WRIST + 1}," in text
        yield log.label, float(np.median(limits)), named


def _advice(lib: Library, motion: Trajectory, case: Case, seed: int) -> str:
    return _identified(lib, motion, case, seed).advice()


def _identified(lib: Library, motion: Trajectory, case: Case, seed: int) -> Uncertainty:
    rng, log = np.random.default_rng([seed, 11]), case.log
    plant = Plant(case.robot(lib, rng), viscous=VISCOUS, coulomb=COULOMB)
    run = ideal(lib, motion, plant, log.rate_hz)
    q, dq, tau = (
        np.tile(rows, (log.repetitions, 1)) for rows in (run.q, run.required("dq"), run.tau)
    )
    noise = rng.normal(size=tau.shape)
    if log.rho:
        noise = signal.lfilter([np.sqrt(1 - log.rho**2)], [1, -log.rho], noise, axis=0)
    t = np.arange(len(q)) / log.rate_hz
    recording = Recording(t=t, q=q, dq=dq, tau=case.torque(tau + NOISE * noise, dq), name="trial")
    result = identify(recording, lib, preparation=FILTERED, friction_columns=TERMS)
    assert result.uncertainty is not None  # noqa: S101  certify is on
    return result.uncertainty
