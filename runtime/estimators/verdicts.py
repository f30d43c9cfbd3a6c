"""Verdicts on parameters: determined by the data, by the prior, or without effect on the torque."""

import numpy as np

from runtime.estimators.convex.posterior_spread import DETERMINED, Spread
from runtime.library import Array

IDENTIFIED, PRIOR_DOMINATED, UNOBSERVABLE = "identified", "prior-dominated", "unobservable"
ALONE = 0.5
"""Share of the posterior precision of a base parameter that the data bring without the prior, below
which the prior decides: its interval holds more often than its level states, up to 100 %."""


def verdict(silent: bool, share: float) -> str:
    """Verdict on an entry of π."""
    if silent:
        return UNOBSERVABLE
    return IDENTIFIED if share < DETERMINED else PRIOR_DOMINATED


def beta_verdicts(base: Array, spread: Spread, vague: Array) -> tuple[str, ...]:
    """Verdicts on the base parameters β = K π.

    base (n_b, 10 n), vague (10 n, 10 n) → (n_b,).
    """
    tight, loose = (np.sum((base @ root) ** 2, axis=1) for root in (spread.root, vague))
    by_data = tight >= ALONE * loose
    return tuple(
        verdict(False, float(share)) if enough else PRIOR_DOMINATED
        for enough, share in zip(by_data, spread.share_of(base), strict=True)
    )
