"""What the settings and a file of priors know of friction and noise of a log."""

import numpy as np

from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.identification.settings import Settings
from runtime.recording import Friction


def known_friction(
    settings: Settings, columns: tuple[str, ...], friction: Friction
) -> FrictionPrior | None:
    """Prior of the friction coefficients, of the settings or of a file of priors."""
    prior = settings.prior
    if settings.friction_prior is not None or prior is None:
        return settings.friction_prior
    known = None if prior.friction is None else prior.friction.of(friction, columns)
    if prior.armature is None:
        return known
    from runtime.estimators.armature_prior import friction_prior_of

    rotors = friction_prior_of(prior.armature, columns)
    if known is None:
        return rotors
    stated = np.isfinite(rotors.sigma)
    return FrictionPrior(
        np.where(stated, rotors.mean, known.mean), np.where(stated, rotors.sigma, known.sigma)
    )


def known_noise(settings: Settings, regressor: str) -> NoiseFloor | None:
    """Least noise of the torque, of a file of priors."""
    prior = settings.prior
    return prior.noise if prior is not None and regressor == "acceleration" else None
