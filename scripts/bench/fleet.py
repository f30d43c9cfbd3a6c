"""Fleet: 3 s of motion of a new unit with the prior of 20 others, against 20 s without.

The units are virtual FR3s with friction, delay and sensor biases. Their links differ by 5 % from
those of a type, which is 20 % off the URDF. The test is a third motion of the same unit.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.front import SHORT, cpu_seconds, python
from bench.trials import trajectories
from runtime import Identification, Recording, choose_default_friction
from runtime.estimators.prior_file import PriorFile, read_prior
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.single_log import identify_recording
from runtime.identification.statistics_file import FILE, statistics_of, write_statistics
from runtime.library import Array, Library
from runtime.monitoring.fleet import fleet_prior
from runtime.monitoring.fleet.gather import unit_of
from runtime.recording import Friction, Preparation
from runtime.recording.preprocessing import prepare
from runtime.recording.settings import EVERYTHING
from runtime.simulation import Plant, ideal
from runtime.simulation.settings import settings_of
from runtime.simulation.virtual_robot import perturbed, record

OF_TYPE, SPREAD = 0.2, 0.05  # distance of the type from the URDF, and spread of the units
SHORT_S, PAUSE_S = 3.0, 10.0
"""Length of the short motion, and pause between two motions of a log, s."""
TERMS = Friction(("viscous", "dahl", "offset", "stribeck", "load"))
"""Friction model of the fleet: 20 units determine what one log of 20 s hardly does."""
FILTERED = Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=100.0)
WAYS = (
    "3 s, without fleet",
    "20 s, without fleet",
    "20 s, without fleet, friction columns of the fleet",
    "3 s of another motion, with the fleet",
    "3 s of a designed motion, with the fleet",
    "20 s, with the fleet",
)
"""Without a fleet the friction model is that which `identify` chooses for the log."""


@dataclass(frozen=True, slots=True)
class FleetTrials:
    """Errors of new units."""

    fit: fleet_prior.FleetFit
    rms: Array  # RMS torque error on the test motion by way and unit, (6, count, n) [N·m]
    consistent: bool  # whether all links of all models are strictly consistent


def fleet_trials(
    lib: Library, designs: tuple[Trajectory, ...], units: int, count: int, of_friction: float
) -> FleetTrials:
    """Identify a fleet, and new units from short and long motions."""
    one, two = designs[:2]
    other = Trajectory(lib.home, (one.coefficients + two.coefficients) / 2, one.duration)
    centre = perturbed(lib, lib.pi0, OF_TYPE, np.random.default_rng(0))
    known = []
    for u in range(units):
        log = joined(
            *(motion(lib, centre, d, (u, k), of_friction) for k, d in enumerate((one, two)))
        )
        result = identified(lib, log, TERMS, None)
        known.append(unit_of(statistics_of(result, f"u{u}"), lib, f"u{u}"))
    fit = fleet_prior.fit_fleet(lib, known)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "fleet.toml"
        text = fleet_prior.prior_text(
            lib,
            [u.name for u in known],
            fit,
            fleet_prior.fit_friction(lib, known, fit),
            fleet_prior.fit_noise(known, fit),
        )
        fleet_prior.write_prior(path, text, lib)
        prior = read_prior(path, lib)
    rms = np.zeros((len(WAYS), count, lib.n_joints))
    consistent = bool((lib.relative_eigenvalues(fit.pi) > 0).all())
    (designed,) = trajectories(SHORT, lib)
    for k in range(count):
        u = units + k
        logs = [
            motion(lib, centre, d, (u, number), of_friction)
            for number, d in enumerate((one, two, other, designed))
        ]
        long, test, best = joined(*logs[:2]), logs[2], logs[3]
        start = np.random.default_rng([5, k]).uniform(0, one.duration - SHORT_S)
        short = long.take((long.t >= start) & (long.t < start + SHORT_S), "short")
        alone, usual = (choose_default_friction(log, lib, FILTERED).terms for log in (short, long))
        ways = (
            (short, alone, None),
            (long, usual, None),
            (long, TERMS, None),
            (short, TERMS, prior),
            (best, TERMS, prior),
            (long, TERMS, prior),
        )
        for way, (log, terms, given) in enumerate(ways):
            result = identified(lib, log, terms, given, certify=False)
            samples = samples_of(prepare(test, FILTERED, terms, lib=lib), lib)
            rest = result.predict_samples(samples) - samples.tau
            rms[way, k] = np.sqrt(np.mean(rest**2, axis=0))
            consistent &= bool((lib.relative_eigenvalues(result.pi) > 0).all())
    return FleetTrials(fit, rms, consistent)


def motion(
    lib: Library, centre: Array, design: Trajectory, which: tuple[int, int], of_friction: float
) -> Recording:
    """One log, by unit and number, of the type `centre`."""
    unit, number = which
    rng = np.random.default_rng([3, unit])
    usual = settings_of(lib)
    factors = np.exp(of_friction * rng.normal(size=(2, lib.n_joints)))
    friction = replace(
        usual.friction,
        coulomb=usual.friction.coulomb * factors[0],
        viscous=usual.friction.viscous * factors[1],
    )
    settings = replace(usual, spread=SPREAD, friction=friction)
    seed = 10 * unit + number + 1
    return record(lib, design, settings, seed=seed, truth_seed=unit, pi=centre).recording


def joined(first: Recording, second: Recording, pause_s: float = PAUSE_S) -> Recording:
    """Two motions as one log with a pause."""
    later = second.t + first.t[-1] + pause_s
    pair, keys = (first, second), ("q", "dq", "tau")
    q, dq, tau = (np.concatenate([getattr(log, key) for log in pair]) for key in keys)
    t = np.concatenate([first.t, later])
    return Recording(t, q, dq, None, tau, name="unit", joint_names=first.joint_names)


def identified(
    lib: Library, log: Recording, terms: Friction, prior: PriorFile | None, certify: bool = True
) -> Identification:
    """The unit by the default method with all rows."""
    settings = {"preparation": FILTERED, "friction": terms, "split": EVERYTHING}
    return identify_recording(log, lib, prior=prior, certify=certify, **settings)


NOISE = 0.3  # torque noise, N·m
PLAIN = Friction(("viscous", "coulomb"))
FRICTION = (0.5, 0.3)


def fleet_seconds(lib: Library, design: Trajectory, count: int) -> tuple[float, float]:
    """CPU and wall time of the command."""
    log = ideal(lib, design, Plant(lib.pi0, torque_noise=NOISE))
    usual = statistics_of(identified(lib, log, PLAIN, None), "unit")
    rng, known = np.random.default_rng(0), usual.statistics
    centre = perturbed(lib, lib.pi0, 4 * SPREAD, rng)
    with TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(count):
            beta = lib.base_matrix @ perturbed(lib, centre, SPREAD, rng)
            x = np.concatenate([beta, np.tile(FRICTION, lib.n_joints)])
            unit = folder / "units" / f"u{k:04d}"
            unit.mkdir(parents=True)
            target = known.factor @ x + rng.normal(size=len(known.target))
            write_statistics(replace(usual, statistics=replace(known, target=target)), unit / FILE)
        words = ["fleet", "units", "--robot", str(lib.folder.resolve()), "--out", "fleet.toml"]
        start, before = time.perf_counter(), cpu_seconds()
        python("-m", "runtime", *words, folder=folder).check_returncode()
        return cpu_seconds() - before, time.perf_counter() - start
