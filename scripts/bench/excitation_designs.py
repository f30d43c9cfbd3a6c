"""Designs of `scripts/bench_excitation --designs`: what `identify` makes of their logs.

ideal     exact motion, friction of the columns that are fitted, white torque noise: the real
error of other motions' torque against what `predict` expects
MuJoCo    virtual arms with friction beyond the columns, gains, delays, a controller: the real
error, and what `predict` expects from the residuals of the log and the accuracy of the gains
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bench.compiled import processor
from bench.front import BenchError, Sheet, sheet_of
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.search.criteria import unseen_joints
from runtime.excitation.search.design import Design, design
from runtime.excitation.search.information import FRICTION, information
from runtime.identification.expected_accuracy.expected import (
    Knowledge,
    expected,
    gain_slopes,
    unseen_torque,
)
from runtime.identification.expected_accuracy.planned_samples import (
    MotionSamples,
    motion_samples_of,
    noise_of,
    planned_recording,
)
from runtime.identification.single_log import identify_recording as fit
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.simulation import Plant, ideal, record, sample_times
from runtime.simulation.closed_loop import perturbed_lam

NOISE, RATE, SPREAD = 0.05, 100.0, 0.05
"""Torque noise, N·m, rate, Hz, and relative error of the URDF's λ on ideal arms."""
PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=RATE)
"""Of the logs of virtual arms, which have 1 kHz."""
TERMS = Friction()
PLANT = {"viscous": 0.3, "coulomb": 0.5, "offset": 0.1, "coulomb_speed": TERMS.coulomb_speed}


@dataclass(frozen=True, slots=True)
class Shape:
    """A design: number of harmonics, duration [s], and whether friction is counted."""

    harmonics: int
    duration: float
    friction: tuple[str, ...]


SHAPES = (
    Shape(5, 10.0, ()),
    Shape(5, 10.0, FRICTION),
    Shape(8, 10.0, FRICTION),
    Shape(10, 10.0, FRICTION),
    Shape(8, 20.0, ()),
    Shape(8, 20.0, FRICTION),
)

COLUMNS = {
    **{"M": "", "t_f s": "g", "friction counted": "", "cond": ".2f", "expected V": ".1f"},
    **{"real, ideal": ".1f", "expected / real": ".2f", "real, MuJoCo": ".0f"},
    **{"by residuals": ".0f", "with gains": ".0f", "real / with gains": ".2f", "CPU s": ".0f"},
}
"""Condition number of the base regressor; RMS errors of the torque of other motions, all joints,
mN·m: of `predict`, of ideal and virtual arms, of `predict` with the residuals of the logs of
virtual arms, and with the errors of the gains that virtual sensors have."""


def measure(
    lib: Library,
    shapes: tuple[Shape, ...],
    starts: int,
    draws: int,
    arms: int,
    seed: int,
    say: Callable[[str], None],
) -> Sheet:
    """Design, record and identify."""
    rows = []
    for shape in shapes:
        row = _row(lib, shape, starts, draws, arms, seed)
        say(f"M {shape.harmonics}, {shape.duration:g} s: {row[7]:.0f} mN·m")
        rows.append(row)
    title = f"{lib.name}: designs and what identify makes of them, {processor()}"
    caption = (
        f"Criterion mixed, all limits and a table, best of {starts} starts. Errors: RMS "
        f"torque error on unseen motions, mN·m, over {draws} ideal and {arms} "
        "virtual arms. Expected, by residuals and with gains: what predict states of the planned "
        "motion and of the logs, with the gain error of the virtual sensors."
    )
    return sheet_of("bench_excitation_designs", COLUMNS, rows, title=title, caption=caption)


def _row(lib: Library, shape: Shape, starts: int, draws: int, arms: int, seed: int) -> tuple:
    start = time.process_time()
    result = _designed(lib, shape, starts, seed)
    cpu, motion = time.process_time() - start, result.trajectory
    joints = unseen_joints(lib, lib.home)
    t = sample_times(motion.duration, RATE)
    planned = motion_samples_of(planned_recording(motion, t, lib, "planned"), lib, None, TERMS)
    stated = _expected_error(lib, planned, np.full(lib.n_joints, NOISE), joints)
    errors = [_ideal(lib, motion, each, joints) for each in range(draws)]
    virtual = np.array([_virtual(lib, motion, each, joints) for each in range(arms)])
    real, residual, whole = np.sqrt(np.mean(virtual**2, axis=0))
    ideal = _rms(errors)
    head = (shape.harmonics, shape.duration, "yes" if shape.friction else "no", result.condition)
    of_arms = (1e3 * real, 1e3 * residual, 1e3 * whole, real / whole)
    return (*head, 1e3 * stated, 1e3 * ideal, stated / ideal, *of_arms, cpu)


def _designed(lib: Library, shape: Shape, starts: int, seed: int) -> Design:
    return design(
        lib,
        duration=shape.duration,
        harmonics=shape.harmonics,
        starts=starts,
        seed=seed,
        criterion="mixed",
        information=information(lib, NOISE, RATE, friction=shape.friction),
        safety=Safety(table=0.0),
    )


def _ideal(lib: Library, motion: Trajectory, seed: int, joints: Array) -> float:
    rng = np.random.default_rng(seed)
    pi = lib.pi_from_lam(perturbed_lam(lib, SPREAD, rng))
    log = ideal(lib, motion, Plant(pi, torque_noise=NOISE, **PLANT), RATE, rng)
    return error_of(lib, log, None, pi, joints)


def _virtual(
    lib: Library, motion: Trajectory, seed: int, joints: Array
) -> tuple[float, float, float]:
    """Real error on the virtual arm with this seed, and that expected without and with gains."""
    log = record(lib, motion, seed=seed, truth_seed=seed)
    real = error_of(lib, log.recording, PREPARATION, log.truth.pi, joints)
    gain_error = float(log.truth.settings.sensors.torque_gain[0])
    return real, *expected_error_of(lib, log.recording, joints, gain_error)


def expected_error_of(
    lib: Library, log: Recording, joints: Array, gain_error: float = 0.0
) -> tuple[float, float]:
    """What `predict` states of a log with torque."""
    moved = motion_samples_of(log, lib, PREPARATION, TERMS)
    noise = noise_of(lib, moved)
    if noise is None:
        raise BenchError(f"the log '{log.name}' has no noise")
    known = replace(Knowledge.of(lib), pi=noise.pi, error=noise.error)
    stated = _expected_error(lib, moved, noise.sigma, joints, known, noise.inflation)
    slopes = gain_slopes(lib, moved, noise.sigma, known, noise.inflation)
    gains = np.linalg.norm(unseen_torque(gain_error * (lib.base_matrix @ slopes), joints))
    return stated, float(np.hypot(stated, gains))


def error_of(
    lib: Library, log: Recording, preparation: Preparation | None, pi: Array, joints: Array
) -> float:
    """Error of the torque of other motions by the default method, fitted to all rows."""
    result = fit(log, lib, preparation=preparation, friction=TERMS, refit=True, certify=False)
    wrong = result.beta - lib.base_matrix @ pi
    return float(np.sqrt(np.einsum("k,jkl,l->", wrong, joints, wrong)))


def _expected_error(
    lib: Library,
    moved: MotionSamples,
    sigma: Array,
    joints: Array,
    known: Knowledge | None = None,
    unit: float = 1.0,
) -> float:
    statistics = moved.statistics(lib, sigma)
    sigmas = expected(lib, statistics, known or Knowledge.of(lib), unit, moved.columns)
    return float(np.linalg.norm(unseen_torque(lib.base_matrix @ sigmas.root, joints)))


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
