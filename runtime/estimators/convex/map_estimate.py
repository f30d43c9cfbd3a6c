"""Maximum a posteriori with an entropic prior: the default method.

Weights w_j = 1/s_j² come from the residuals, γ = κ s²/N_eff from the trust in the URDF and from how
many independent samples the residuals are worth, N_eff = N / (1 + 2 Σ ρ_l) over 24 lags. Slower
patterns are rather friction that the model lacks than noise, and for friction the URDF stands in no
better; how far they bend the answer is told by its σ, which counts them (`coloured_noise`).
"""

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD, Minimum, Prior, convex_problem, prior_of, reduce, solve
from runtime.estimators.convex.constraints import Constraints, constrained
from runtime.estimators.method import Method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.coloured_noise import coloured_noise_of
from runtime.estimators.regression.residuals import inflation, noise, residuals, weights_from
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

PASSES = 3
"""Re-estimations of the weights."""
ENOUGH = 2000
"""Samples that give a weight to 2 %; the passes before the last take no more than these."""
LEAST_VARIANCE = 1e-4
"""Of weighted residuals, whose variance is about one; below, torques are exact to rounding and the
prior speaks only where the data are silent."""


def fit_map(problem: Problem, kappa: float = CAD, constraints: Constraints | None = None) -> Fit:
    """The most probable bodies, strictly consistent, with the friction that goes with them.

    Args:
        problem: its weights are only where the passes begin.
        kappa: trust in the first guess: 16 from CAD, 4 for a gripper, 1 for none.
        constraints: further linear priors.

    Raises:
        IdentificationError: κ that is not above 0, or priors that contradict each other.
    """
    if not (np.isfinite(kappa) and kappa > 0):
        raise IdentificationError(
            f"expected a trust κ above 0, got {kappa:g}; 16 for a URDF from CAD, 1 for none"
        )
    lib, train = problem.lib, problem.train
    prior = prior_of(lib, lib.pi_from_lam(problem.start))
    few = _thinned(train)
    weights = problem.weights
    for _ in range(PASSES):
        phi, found, _ = _fitted(lib, compress(lib, few, weights), weights, prior, kappa)
        rest = residuals(lib, few, found.pi, phi)
        weights = weights_from(noise(rest, lib, phi.size), few.tau)
    statistics = problem.statistics(weights)
    phi, found, _ = _fitted(lib, statistics, weights, prior, kappa)
    worth = inflation(residuals(lib, train, found.pi, phi), weights)
    phi, found, notes = _fitted(lib, statistics, weights, prior, kappa, worth, constraints)
    return Fit(
        pi=found.pi,
        phi=phi.reshape(train.columns.shape[1:]),
        lam=lib.lam_from_pi(found.pi),
        status=_status(found),
        iterations=found.steps,
        notes=(*prior.notes, *notes),
        statistics=statistics,
        weights=weights,
        coloured_noise=coloured_noise_of(lib, [train], statistics, weights),
    )


def fit_with_prior(problem: Problem, prior: PriorFile | None = None) -> Fit:
    """The same with κ and the linear priors of a file.

    Args:
        problem: its weights are only where the passes begin.
        prior: file of inertial priors; None for the URDF alone.

    Returns:
        The most probable consistent model.

    Raises:
        IdentificationError: the priors contradict each other.
    """
    kappa = prior.kappa if prior and prior.kappa else CAD
    return fit_map(problem, kappa, prior.constraints if prior else None)


def _fitted(
    lib: Library,
    statistics: Statistics,
    weights: Array,
    prior: Prior,
    kappa: float,
    worth: float = 1.0,
    constraints: Constraints | None = None,
) -> tuple[Array, Minimum, tuple[str, ...]]:
    """φ and the minimum of one weighting, a weight per equation of a sample; worth is N/N_eff."""
    data, eliminated = reduce(statistics, len(weights))
    gamma = kappa * max(data.variance, LEAST_VARIANCE) * worth / data.count
    notes: tuple[str, ...] = ()
    if constraints is None:
        found = solve(lib, convex_problem(data, prior, gamma))
    else:
        found, notes = constrained(constraints, data, prior, gamma)
    return eliminated.phi(found.pi), found, notes


def _thinned(samples: Samples) -> Samples:
    step = max(1, len(samples) // ENOUGH)
    return samples.rows(slice(None, None, step))


def _status(found: Minimum) -> str:
    if found.converged:
        return f"converged: most probable consistent model, {found.steps} Newton steps"
    return (
        f"stopped after {found.steps} Newton steps, decrement {found.decrement:.1e}; the model is "
        "consistent, but check units and outliers of the torque"
    )


MAP = Method(
    "map",
    "most probable consistent model given the URDF as a prior, one convex problem (default)",
    fit_with_prior,
    from_statistics=True,
    takes_prior=True,
)
