"""Coverage of 95 % intervals: base parameters, torque band, payload and torque gains.

Every trial records an empty run and a run with a known box of another motion, identifies the arm,
the box with that arm, and the torque gains. Robots are drawn about the URDF. Noise is white,
filtered by the preparation, or autocorrelated; in the other cases the model is wrong: friction that
viscous and Coulomb columns do not describe, gains of the sensors, and a delay of the torque.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from runtime import Identification, Recording, identify, identify_payload
from runtime.estimators.regression.residuals import NORMAL_95
from runtime.excitation import Trajectory
from runtime.identification.payload.arm import ArmModel
from runtime.identification.payload.body import Body, body_of, mount_of
from runtime.identification.payload.known import KnownPayload
from runtime.identification.sensor_gains.estimate import identify_gains
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split
from runtime.simulation import Plant, ideal
from runtime.simulation.box_payload import Box
from runtime.simulation.virtual_robot import perturbed, record

Array = NDArray[np.float64]

NOISE, SPREAD = 0.05, 0.1
"""Standard deviation of the torque noise, N·m, and spread of the robots about the URDF."""
VISCOUS, COULOMB = 0.5, 0.3
TERMS = Friction(("viscous", "coulomb", "offset"), 0.03)
LINK = "fr3_link7"
LOAD = Box(2.0, (0.01, 0.02, 0.15), (0.1, 0.08, 0.06), LINK)
SPLIT = Split((0.0, 0.7), (0.7, 0.75), (0.75, 1.0))
RHO = 0.9
"""Correlation of coloured noise at 100 Hz: a time constant of 0.1 s."""
GAIN, DELAY = 0.02, 0.003
"""Relative standard deviation of wrong gains, and delay of the torque, s."""
FILTERED = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=100.0)
DISTRUST = ("do not trust", "too narrow")
"""Parts of an advice that state a broken assumption."""


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
        result = identify(
            pair.empty, lib, preparation=preparation, splitting=SPLIT, friction_columns=TERMS
        )
        u = result.uncertainty
        assert u is not None  # noqa: S101  certify is on
        wrong = result.beta - lib.base_matrix @ pair.pi
        base.append(np.abs(wrong) < NORMAL_95 * u.beta_sigma)
        determined.append([v == "identified" for v in u.beta_verdicts])
        named.append(any(words in u.advice() for words in DISTRUST))
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
    arm = ArmModel(result.pi, result.friction, result.phi, "identified")
    body = identify_payload(pair.loaded, result.lib, LINK, arm=arm, preparation=preparation).body
    wrong = body.values - _body(result.lib).values
    return float(np.mean(np.abs(wrong) < NORMAL_95 * body.sigma))


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
