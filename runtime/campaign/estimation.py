"""Model of the arm from all logs of a campaign, and how well a new log agrees with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.campaign.gear_friction import (
    LOAD,
    NAMES,
    SPREAD,
    GearFriction,
    gear_of,
    prepared_log,
)
from runtime.errors import IdentificationError
from runtime.estimators.convex.constraints import Constraints
from runtime.estimators.convex.entropic_prior import NONE
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.compression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import Uncertainty, uncertainty_of
from runtime.identification.identified import Identification, torque_of
from runtime.identification.several_logs import joined
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.settings import EVERYTHING

PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0, rate_hz=50.0, trim_s=0.1)
"""Of every log. Motions of five harmonics end below 3 Hz; above 10 Hz the accelerations of encoders
of 10 µrad are noisier than torque sensors."""
UNSEEN_RIPPLE, UNSEEN_FRICTION = 0.005, 0.3
"""σ of torques that logs so far have not shown, over the range of the torque of a joint and over
its friction: a slow stage shows the friction of full speed to a third."""
ASYMMETRY, PEAK, RIPPLE = 0.2, 0.5, 0.1
"""σ over the dry friction of a joint: difference between the directions, Stribeck peak, ripple."""
VAGUE = PriorFile(NONE, Constraints())
"""A campaign is for arms whose URDF may be wrong, and its data determine the base parameters."""


@dataclass(frozen=True, slots=True)
class ArmModel:
    """Model of an arm and its joints."""

    # identification from all logs; its friction columns are those of the gear
    result: Identification
    gear: GearFriction  # what these columns depend on


def arm_model(lib: Library, motions: Sequence[tuple[str, Recording]], first: int = 0) -> ArmModel:
    """Identify the arm from all rows of all logs, with one offset per joint and log."""
    usual = GearFriction.usual(lib.n_joints)
    gear = gear_of([each for _, each in motions[first:]], lib, PREPARATION, usual)
    names = [name for name, _ in motions]
    prepared = [prepared_log(each, gear, PREPARATION) for _, each in motions]
    known = gear_prior(gear, len(motions))
    result = identify_recording(
        joined(prepared, names, names),
        lib,
        method="map",
        prior=VAGUE,
        preparation=Preparation(),
        split=EVERYTHING,
        friction=Friction(NAMES),
        friction_prior=known,
    )
    spread = _uncertainty(result, known, [len(each.t) for each in prepared])
    return ArmModel(replace(result, log_names=tuple(names), uncertainty=spread), gear)


def _uncertainty(result: Identification, known: FrictionPrior, rows: list[int]) -> Uncertainty:
    """Uncertainty with the prior of the friction columns, and the noise of base parameters.

    What the friction columns do not describe has the frequencies of friction; averaged over all
    unknowns it would widen the intervals of β, which are orthogonal to these columns, by a third.
    """
    first, lib = result.uncertainty, result.lib
    if first is None or first.information is None:
        raise IdentificationError("expected a model with a posterior; identify with map")
    samples = samples_of(result.train, lib)
    statistics = compress(lib, samples, result.weights)
    ends = np.cumsum(rows)
    parts = [samples.rows(slice(b - n, b)) for b, n in zip(ends.tolist(), rows, strict=True)]
    coloured = coloured_noise_of(lib, parts, statistics, result.weights, only_base=True)
    posterior = uncertainty_of(
        lib,
        samples,
        result.pi,
        result.phi,
        first_guess=lib.pi0,
        kappa=NONE,
        statistics=statistics.merged(known.statistics(statistics, coloured.density)),
        coloured_noise=coloured,
        tests=False,
    )
    return replace(posterior, tests=first.tests)


def gear_prior(gear: GearFriction, logs: int) -> FrictionPrior:
    """Prior of the columns that gears show beside dry and viscous friction.

    Ripple, Stribeck peak and the difference between the directions are shares of the dry friction.
    Without the prior a short log leaves their sum with the torque of the links open. Errors of the
    parameters have the prior of their search, so that the posterior counts them.
    """
    dry = np.maximum(np.abs(gear.phi[:, 0]), 1e-9)
    free = np.full((len(dry), 1), np.inf)
    shares = dry[:, None] * np.array([ASYMMETRY, PEAK, RIPPLE, RIPPLE])
    load, errors = np.full_like(free, LOAD), np.tile(SPREAD, (len(dry), 1))
    parts = (free, shares[:, :2], load, free, shares[:, 2:], errors, *[free] * logs)
    sigma = np.concatenate(parts, axis=1)
    return FrictionPrior(np.zeros_like(sigma), sigma)


def agreement_of(model: ArmModel, motion: Recording, unseen: float = 1.0) -> tuple[float, ...]:
    """RMS of the residual of a new log over the RMS of the stated band, per joint."""
    result, shared = model.result, len(NAMES) - 1
    if result.uncertainty is None:
        raise IdentificationError("expected a model with an uncertainty; identify with map")
    lib = result.lib
    prepared = prepared_log(motion, model.gear, PREPARATION)
    # Offsets of sensors drift between logs: no offset, and a residual without its mean.
    prepared = prepared.replace(
        columns=np.asarray(prepared.columns)[..., :shared], column_names=NAMES[:shared]
    )
    samples = samples_of(prepared, lib)
    phi = result.phi[:, :shared]
    rest = samples.tau - torque_of(lib, samples, result.pi, phi, None)
    rest = rest - rest.mean(axis=0)
    band = np.hypot(result.uncertainty.band_of(lib, samples), result.uncertainty.noise)
    # What logs so far have not shown: friction at other speeds, ripple at other places.
    ripple = UNSEEN_RIPPLE * np.ptp(samples.tau, axis=0)
    friction = UNSEEN_FRICTION * np.sqrt(np.mean(samples.friction(phi) ** 2, axis=0))
    band = np.hypot(band, unseen * np.hypot(ripple, friction))
    ratio = np.sqrt((rest**2).mean(axis=0) / (band**2).mean(axis=0))
    return tuple(map(float, ratio))
