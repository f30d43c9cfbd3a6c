"""Monitoring: bands of drawn models, and results that are written and read again.

Robots are drawn about the FR3's URDF.
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
from runtime.monitoring.posterior_draws import draw_models
from runtime.recording import Friction, Preparation
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed

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
    """Share of the true torques of another motion within the 95 % band of drawn models."""
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


def stated(per_hour: float) -> AlarmRate:
    """Rate of false alarms per hour."""
    return alarm_rate(f"{per_hour:g} per hour")
