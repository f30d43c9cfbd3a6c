"""Noise of a fleet: what the residuals of a few seconds of a new unit cannot show.

Few rows are explained too well by many unknowns; the residuals of long logs of other units show how
large and how coloured the errors of the model are.
"""

from collections.abc import Sequence

import numpy as np

from runtime.estimators.problem import NoiseFloor
from runtime.monitoring.fleet.hierarchy import LEAST, FleetFit
from runtime.monitoring.fleet.unit import Unit


def fit_noise(units: Sequence[Unit], fit: FleetFit) -> NoiseFloor | None:
    """Usual noise of the units of a type.

    Returns (n,) [N·m, N].
    """
    pairs = zip(units, fit.stands_out, strict=True)
    counted = [unit for unit, is_out in pairs if not is_out and np.isfinite(unit.noise).all()]
    if len(counted) < LEAST:
        return None
    sigma = np.median([unit.noise for unit in counted], axis=0)
    return NoiseFloor(sigma, max(float(np.median([unit.density for unit in counted])), 1.0))
