"""Virtual units of a fleet, known to the last digit."""

import dataclasses

import numpy as np

from runtime import Recording
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import samples_of
from runtime.identification.statistics_file import UnitStatistics
from runtime.library import Library
from runtime.monitoring.fleet.gather import Unit
from runtime.recording import Friction
from runtime.recording.preprocessing import prepare

UNITS, SPREAD, NOISE = 20, 0.05, 0.3
"""Number of units, their relative spread (κ = 1/SPREAD² = 400), and torque noise, N·m."""
TERMS = Friction(("viscous", "coulomb"))
VISCOUS, COULOMB, OF_FRICTION = 0.5, 0.3, 0.1


@dataclasses.dataclass(frozen=True)
class Fleet:
    """Virtual units of one type, known to the last digit."""

    type: np.ndarray
    pi: tuple[np.ndarray, ...]
    statistics: tuple[UnitStatistics, ...]
    units: tuple[Unit, ...]


def statistics_about(
    lib: Library, motion: Recording, pi: np.ndarray, name: str, rng: np.random.Generator
) -> UnitStatistics:
    """Statistics of one unit: exact triangle of the motion, target with its noise."""
    samples = samples_of(prepare(motion, None, TERMS, lib=lib), lib)
    whole = compress(lib, samples, np.full(lib.n_joints, NOISE**-2))
    phi = np.array([VISCOUS, COULOMB]) * np.exp(OF_FRICTION * rng.normal(size=(lib.n_joints, 2)))
    x = np.concatenate([lib.base_matrix @ pi, phi.ravel()])
    target = whole.factor @ x + rng.normal(size=x.size)
    rest = float(lib.n_joints * len(samples))
    drawn = dataclasses.replace(whole, target=target, rest=rest)
    return UnitStatistics(
        drawn,
        density=1.0,
        unit=name,
        robot=lib.name,
        joints=lib.joint_names,
        columns=TERMS.columns,
        widths=(0.02, 0.1, 0.002),
    )
