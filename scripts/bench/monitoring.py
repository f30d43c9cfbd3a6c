"""Monitoring: bands of drawn models, false alarms and steps of the observer, changes of a robot.

Robots are drawn about the FR3's URDF; the observer watches the virtual FR3 of `runtime.simulation`.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from runtime import Identification, Recording, identify
from runtime.excitation import Trajectory
from runtime.identification.posterior_file import Posterior, read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import SavedResult, read_result
from runtime.library import Library
from runtime.monitoring.false_alarms import AlarmRate, alarm_rate
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import read_held_out
from runtime.monitoring.observation import Detector, detector_for, observe, prepared_for
from runtime.monitoring.posterior_draws import draw_models
from runtime.recording import Friction, Preparation
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed, record

Array = NDArray[np.float64]

NOISE, SPREAD = 0.05, 0.1
"""Standard deviation of the torque noise, N·m, and spread of the robots about the URDF."""
VISCOUS, COULOMB = 0.5, 0.3
TERMS = Friction(("viscous", "coulomb", "offset"), 0.03)
OF_ARM = Friction(("viscous", "coulomb", "offset"))
FILTERED = Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=100.0)


@dataclass(frozen=True, slots=True)
class Saved:
    """A result that was written and read again."""

    saved: SavedResult
    posterior: Posterior


def saved_of(lib: Library, result: Identification, folder: Path) -> Saved:
    """Write a result and read it with its posterior."""
    write_result(result, folder, "scripts/monitoring_table")
    saved = read_result(folder)
    return Saved(saved, read_posterior(folder, saved, lib))


def draws_coverage(
    lib: Library, designs: tuple[Trajectory, ...], trials: int, draws: int
) -> tuple[float, float]:
    """Share of the true torques of another motion within the 95 % band of drawn models.

    Args:
        lib: the FR3.
        designs: training motion and another one.
        trials: number of robots.
        draws: number of models per robot.

    Returns:
        The share over all samples, and the share of consistent draws.
    """
    inside, consistent = [], []
    for trial in range(trials):
        rng = np.random.default_rng([4, trial])
        pi = perturbed(lib, lib.pi0, SPREAD, rng)
        plant = Plant(pi, viscous=VISCOUS, coulomb=COULOMB, torque_noise=NOISE)
        log = ideal(lib, designs[0], plant, rng=rng)
        result = identify(log, lib, friction_columns=TERMS)
        with TemporaryDirectory() as folder:
            known = saved_of(lib, result, Path(folder))
        drawn = draw_models(lib, known.saved, known.posterior, draws, rng)
        consistent.append(float((lib.relative_eigenvalues(drawn.pi) > 0).mean()))
        other: Recording = ideal(lib, designs[1], plant).take(slice(None, None, 10), "thinned")
        tau = np.stack([lib.inverse_dynamics(other.q, other.dq, other.ddq, pi) for pi in drawn.pi])
        columns = [other.dq, np.tanh(other.dq / TERMS.coulomb_speed), np.ones_like(other.dq)]
        for k, column in enumerate(columns):
            tau += column * drawn.phi[:, None, :, k]
        low, high = np.quantile(tau, [0.025, 0.975], axis=0)
        inside.append(float(np.mean((other.tau >= low) & (other.tau <= high))))
    return float(np.mean(inside)), float(np.mean(consistent))


@dataclass(frozen=True, slots=True)
class Watched:
    """Alarms and pushes of the observer on the virtual FR3.

    Attributes:
        alarms: stated rate [1/h] → alarms that were counted and alarms that were expected.
        found: share of pushes that were found within `WITHIN_S`.
        pushes: number of pushes.
        missed: joint of every push that was not, from 1.
    """

    alarms: dict[float, tuple[int, float]]
    found: float
    pushes: int
    missed: tuple[int, ...]


PUSH = (3.0, 3.0, 3.0, 3.0, 1.0, 1.0, 1.0)
"""Size of the pushes, N·m."""
WITHIN_S, PERIOD_S, LENGTH_S = 0.02, 0.5, 0.25
"""Time within which a push has to be found, time between two pushes, and their length, s."""


def observer_trials(
    lib: Library, designs: tuple[Trajectory, ...], logs: int, rates: tuple[float, ...]
) -> Watched:
    """False alarms and pushes on motions of the virtual FR3 that were not in its training.

    Args:
        lib: the FR3.
        designs: training motion, and those of the logs in turn.
        logs: number of logs.
        rates: stated rates of false alarms, 1/h.

    Returns:
        Counts.
    """
    log = record(lib, designs[0], seed=0).recording
    result = identify(log, lib, preparation=FILTERED, friction_columns=OF_ARM)
    counts = {rate: [0, 0.0] for rate in rates}
    hits: list[tuple[int, bool]] = []
    with TemporaryDirectory() as folder:
        known = saved_of(lib, result, Path(folder))
        model = model_of(known.saved, lib)
        held_out = read_held_out(Path(folder), model)
    root = known.posterior.root(lib)
    for k in range(logs):
        raw = record(lib, designs[1 + k % (len(designs) - 1)], seed=k + 1).recording
        data = prepared_for(raw, model)
        for rate in rates:
            detector = detector_for(lib, model, data, held_out, stated(rate), root=root)
            seen = observe(lib, detector, data)
            counts[rate][0] += len(seen.contacts)
            counts[rate][1] += seen.seconds * rate / 3600
        detector = detector_for(lib, model, data, held_out, stated(1.0), root=root)
        hits += pushed(lib, detector, data, k)
    found = [hit for _, hit in hits]
    return Watched(
        {rate: (int(seen), expected) for rate, (seen, expected) in counts.items()},
        float(np.mean(found)),
        len(found),
        tuple(j + 1 for j, hit in hits if not hit),
    )


def stated(per_hour: float) -> AlarmRate:
    """Rate of false alarms per hour."""
    return alarm_rate(f"{per_hour:g} per hour")


def pushed(lib: Library, detector: Detector, data: Recording, turn: int) -> list[tuple[int, bool]]:
    """Joint of pushes that are added to a log, and whether each was found in time."""
    starts = np.arange(data.t[0] + PERIOD_S, data.t[-1] - PERIOD_S, PERIOD_S)
    joints = [(turn + k) % lib.n_joints for k in range(len(starts))]
    tau = np.array(data.tau)
    for start, j in zip(starts, joints, strict=True):
        tau[(data.t >= start) & (data.t < start + LENGTH_S), j] -= PUSH[j]
    seen = observe(lib, detector, data.replace(tau=tau))
    return [
        (j, any(c.number == j and 0 <= c.time_s - start <= WITHIN_S for c in seen.contacts))
        for start, j in zip(starts, joints, strict=True)
    ]
