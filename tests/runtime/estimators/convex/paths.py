"""The path of falling γ by NumPy, the oracle of the compiled one."""

import numpy as np
import pytest

from runtime.estimators.classical.pc_ols import PATIENCE, Path, gamma_sequence, path_of
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.newton import Minimum, convex_problem, minimise
from runtime.estimators.regression.factor import Reduced
from runtime.library.parameters import N_PARAMETERS


def follow(
    data: Reduced, prior: Prior, gammas: np.ndarray | None = None, most_steps: int = PATIENCE
) -> Path:
    """Minimise at every γ, each started at the one before, up to the first that fails."""
    weights = gamma_sequence(data, prior.centre.size // N_PARAMETERS) if gammas is None else gammas
    minima: list[Minimum] = []
    for gamma in weights:
        start = minima[-1].pi if minima else None
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("runtime.estimators.convex.newton.MOST_STEPS", most_steps)
            minima.append(minimise(convex_problem(data, prior, float(gamma)), start))
        if not minima[-1].converged:
            break
    points, losses = np.array([m.pi for m in minima]), np.array([m.loss for m in minima])
    steps = sum(m.steps for m in minima)
    whole = len(minima) == len(weights) and minima[-1].converged
    tried = weights[: len(minima)]
    return path_of(prior, tried, points, losses, minima[-1].decrement, steps, whole)
