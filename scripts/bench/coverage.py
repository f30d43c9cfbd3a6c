"""Coverage of 95 % intervals, and how often `identify` names faults of a log, rightly or not.

Every trial records an empty run and a run with a known box of another motion, identifies the arm,
the box with that arm, and the torque gains. Robots are drawn about the URDF. Noise is white,
filtered by the preparation, or autocorrelated; in the other cases the model is wrong: friction that
viscous and Coulomb columns do not describe, gains of the sensors, and a delay of the torque. A
fault counts as named if the advice of the result names it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy import signal

from runtime import Identification, Recording, identify_payload
from runtime.estimators.regression import causes
from runtime.estimators.regression.samples import NORMAL_95
from runtime.estimators.uncertainty import Uncertainty
from runtime.excitation import Trajectory
from runtime.identification.payload.arm_error import arm_of_result
from runtime.identification.payload.body import Body, KnownPayload, body_of, mount_of
from runtime.identification.sensor_gains import identify_gains
from runtime.identification.single_log import identify_recording as fit
from runtime.library import Array, Library
from runtime.library.parameters import links
from runtime.recording import Friction, Preparation, Split
from runtime.simulation import Plant, ideal
from runtime.simulation.box_payload import Box
from runtime.simulation.virtual_robot import perturbed, record

NOISE, SPREAD = 0.05, 0.1
"""Standard deviation of the torque noise, N·m, and spread of the robots about the URDF."""
VISCOUS, COULOMB = 0.5, 0.3
TERMS = Friction(("viscous", "coulomb", "offset"), 0.03)
LINK = "fr3_link7"
LOAD = Box(2.0, (0.01, 0.02, 0.15), (0.1, 0.08, 0.06), LINK)
SPLIT = Split((0.0, 0.7), (0.7, 0.75), (0.75, 1.0))
RHO = 0.9  # correlation of coloured noise at 100 Hz: a time constant of 0.1 s
GAIN, DELAY = 0.02, 0.003  # relative standard deviation of wrong gains, and delay of the torque, s
FILTERED = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=100.0)
ALARM = ("do not trust", "too narrow")  # parts of an advice that state a broken assumption


@dataclass(frozen=True, slots=True)
class Pair:
    """Two logs of one robot, and its parameters."""

    empty: Recording  # empty, loaded: logs without and with `LOAD`
    loaded: Recording
    pi: Array  # of the arm, (10 n,)
    gain: Array  # of the torque sensors, (n,)


@dataclass(frozen=True, slots=True)
class Held:
    """Shares of intervals that held, and of trials whose advice names a broken assumption."""

    base: Array  # per base parameter, (n_b,)
    determined: Array  # share of trials in which the data determine it, (n_b,)
    band: float  # of torques of the test part
    payload: float  # of mass, centre of mass and inertia; NaN where none
    gains: float  # of determined gains; NaN where none
    named: float  # trials whose advice states that the result or its intervals are wrong


def pairs(lib: Library, designs: list[Trajectory], case: str, count: int) -> Iterator[Pair]:
    """Logs of a case, one pair a trial."""
    simulate = _mujoco if case == "friction" else _simulated
    for seed in range(count):
        motions = (designs[seed % len(designs)], designs[(seed + 1) % len(designs)])
        yield simulate(lib, motions, case, seed)


def coverage(lib: Library, designs: list[Trajectory], case: str, count: int, more: int = 0) -> Held:
    """Identify `count` pairs of logs and compare the intervals with the truth."""
    preparation = CASES[case][1]
    base, determined, band, payload, gains, named = [], [], [], [], [], []
    for trial, pair in enumerate(pairs(lib, designs, case, count + more)):
        # The virtual sensors have the gains that are stated.
        steps = {"preparation": preparation, "split": SPLIT, "friction": TERMS, "gain_sigma": 0.0}
        result = fit(pair.empty, lib, **steps)
        u = result.uncertainty
        assert u is not None  # noqa: S101  certify is on
        wrong = result.beta - lib.base_matrix @ pair.pi
        base.append(np.abs(wrong) < NORMAL_95 * u.beta_sigma)
        determined.append([v == "identified" for v in u.beta_verdicts])
        named.append(any(words in u.advice() for words in ALARM))
        band.append(_band(result))
        if trial < count:
            payload.append(_payload(pair, result, preparation))
            gains.append(_gains(pair, lib, preparation))
    return Held(
        np.mean(base, axis=0),
        np.mean(determined, axis=0),
        float(np.mean(band)),
        float(np.nanmean(payload)),
        float(np.nanmean(gains)),
        float(np.mean(named)),
    )


def _simulated(lib: Library, motions: tuple[Trajectory, Trajectory], case: str, seed: int) -> Pair:
    """Logs of the regressor model at 100 Hz."""
    rng = np.random.default_rng([seed, 7])
    pi = perturbed(lib, lib.pi0, SPREAD, rng)
    gain = 1 + (GAIN if case == "gains" else 0.0) * rng.normal(size=lib.n_joints)
    logs = []
    for bodies, motion in zip((pi, pi + LOAD.pi(lib)), motions, strict=True):
        run = ideal(lib, motion, Plant(bodies, viscous=VISCOUS, coulomb=COULOMB))
        tau, noise = run.tau, rng.normal(size=run.tau.shape)
        if case == "delay":
            tau = np.stack([np.interp(run.t - DELAY, run.t, row) for row in tau.T], axis=1)
        if case == "coloured":
            noise = signal.lfilter([np.sqrt(1 - RHO**2)], [1, -RHO], noise, axis=0)
        logs.append(run.replace(tau=gain * tau + NOISE * noise))
    return Pair(logs[0], logs[1], pi, gain)


def _mujoco(lib: Library, motions: tuple[Trajectory, Trajectory], case: str, seed: int) -> Pair:
    """Logs of the virtual robot, whose friction has Stribeck, load, ripple and Dahl terms."""
    empty = record(lib, motions[0], seed=seed, truth_seed=seed)
    full = record(lib, motions[1], seed=seed + 1000, truth_seed=seed, payload=LOAD)
    return Pair(empty.recording, full.recording, empty.truth.pi, empty.truth.sensors.gain)


def _body(lib: Library) -> Body:
    """The box in the frame of the mount."""
    mount = mount_of(lib, LINK)
    return body_of(mount.bodies, mount.to_frame @ LOAD.pi(lib)[mount.columns], np.zeros((10, 10)))


def _band(result: Identification) -> float:
    """Share of the torques of the test part within 1.96 σ of the prediction."""
    test, u = result.test, result.uncertainty
    assert u is not None  # noqa: S101  certify is on
    sigma = u.torque_band(result.lib, test.q, test.required("dq"), test.required("ddq"))
    return float(np.mean(np.abs(test.tau - result.predict_recording(test)) < NORMAL_95 * sigma))


def _payload(pair: Pair, result: Identification, preparation: Preparation | None) -> float:
    """Share of the ten values of the box within their intervals, with the identified arm."""
    steps = {"arm": arm_of_result(result), "preparation": preparation, "gain_error": 0.0}
    body = identify_payload(pair.loaded, result.lib, LINK, **steps).body
    return float(np.mean(np.abs(body.values - _body(result.lib).values) < NORMAL_95 * body.sigma))


def _gains(pair: Pair, lib: Library, preparation: Preparation | None) -> float:
    """Share of determined gains within their intervals."""
    box = _body(lib)
    known = KnownPayload(box.mass, box.com, box.inertia, link=LINK)
    terms = Friction(("viscous", "coulomb"), TERMS.coulomb_speed)
    gains = identify_gains(
        pair.empty, pair.loaded, lib, known, friction=terms, preparation=preparation
    )
    held = np.abs(gains.estimate - pair.gain) < NORMAL_95 * gains.sigma
    return float(np.mean(held[gains.is_determined]))


CASES: dict[str, tuple[str, Preparation | None]] = {
    "white": ("white noise", None),
    "filtered": ("white noise, filtered at 10 Hz", FILTERED),
    "coloured": (f"coloured noise, ρ = {RHO} at 100 Hz", None),
    "friction": ("friction of the MuJoCo arm", FILTERED),
    "gains": (f"gains {100 * GAIN:g} % off", None),
    "delay": (f"torque {1e3 * DELAY:g} ms late", None),
}
"""Key → label of the table, and preparation."""

WRONG_GAIN = 1.1
LATE = 0.3  # delay of the torque in rows of 10 ms
PEAK, WIDTH = 1.0, 0.1  # Stribeck peak [N·m] and its speed [rad/s]


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
POWERS = (0.05, 0.1, 0.2, 0.4)  # errors of the gain
WRIST = 6  # index of the joint whose torque is mostly friction


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


def _gain(joint: int, gain: float = WRONG_GAIN) -> Callable[[Array, Array], Array]:
    def torque(tau: Array, _: Array) -> Array:
        return tau * np.where(np.arange(tau.shape[1]) == joint, gain, 1.0)

    return torque


def _peak(tau: Array, dq: Array) -> Array:
    return np.asarray(tau + PEAK * np.exp(-np.abs(dq) / WIDTH) * np.sign(dq))


def _late(tau: Array, _: Array) -> Array:
    rows = np.arange(len(tau))
    return np.stack([np.interp(rows - LATE, rows, column) for column in tau.T], axis=1)


FAULTS = (
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
    for case in FAULTS:
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
            limits.append(float(clean.tests.causes.limits(causes.GAIN)[WRIST]))
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
    result = fit(recording, lib, preparation=FILTERED, friction=TERMS)
    assert result.uncertainty is not None  # noqa: S101  certify is on
    return result.uncertainty
