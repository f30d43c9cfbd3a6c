"""Maximum a posteriori with an entropic prior: the default method.

Weights w_j = 1/s_j² come from the residuals, γ = κ s²/N_eff from the trust in the URDF and the
effective sample size N_eff = N / (1 + 2 Σ ρ_l) over 24 lags. Slower patterns are unmodelled
friction rather than noise, and the prior does not help against friction; the covariance, which
uses `coloured_noise`, includes them.
"""

from dataclasses import replace

import numpy as np

from runtime.common.tables import significant
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, prior_about
from runtime.estimators.convex.newton import (
    Constraints,
    Minimum,
    constrained,
    convex_problem,
    solve,
)
from runtime.estimators.methods import Method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, Held, Problem, bounds_of, notes_of, within_bounds
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of
from runtime.estimators.regression.factor import Statistics, compress, reduce
from runtime.estimators.regression.samples import inflation, noise, residuals, weights_from
from runtime.library import Array

PASSES = 3
ENOUGH = 2000  # samples that determine a weight to 2 %; the passes before the last take no more
LEAST_VARIANCE = 1e-4
"""Smallest variance of the weighted residuals, which is about one. Below it torques are exact to
rounding, and the prior decides only what the motion does not excite."""


def fit_map(
    problem: Problem,
    kappa: float = CAD,
    constraints: Constraints | None = None,
    centre: Array | None = None,
) -> Fit:
    """Maximum a posteriori of π with trust κ in the prior about a centre, and the best friction."""
    if not (np.isfinite(kappa) and kappa > 0):
        raise IdentificationError(
            f"expected a trust κ above 0, got {kappa:g}; use 16 for a URDF from CAD, 1 for none"
        )
    lib, train = problem.lib, problem.train
    prior = prior_about(lib, lib.pi_from_lam(problem.start), centre)
    few = train.rows(slice(None, None, max(1, len(train) // ENOUGH)))
    weights = problem.weights
    bounds = bounds_of(problem, is_passive=True)
    floor = problem.noise_floor
    # Rows over their noise have the variance one; residuals of too few rows are far below it.
    least = LEAST_VARIANCE if floor is None else 1.0

    def solved(
        rows: Statistics, ratio: float = 1.0, limits: Constraints | None = None
    ) -> tuple[Array, tuple[Minimum, tuple[str, ...]], Held]:
        """φ within its bounds, minimum and notes by rows over their noise, with N / N_eff."""

        def unbounded(part: Statistics) -> tuple[Array, Array, tuple[Minimum, tuple[str, ...]]]:
            data, eliminated = reduce(part, train.equations)
            gamma = kappa * max(data.variance, least) * ratio / data.count
            notes: tuple[str, ...] = ()
            if limits is None:
                minimum = solve(lib, convex_problem(data, prior, gamma))
            else:
                minimum, notes = constrained(limits, data, prior, gamma)
            return eliminated.phi(minimum.pi), lib.base_matrix @ minimum.pi, (minimum, notes)

        if problem.friction_prior is not None:
            variance = max(reduce(rows, train.equations)[0].variance, least) * ratio
            rows = rows.merged(problem.friction_prior.statistics(rows, variance))
        return within_bounds(rows, bounds, unbounded)

    # Weights from the residuals of a thinned log, then of all samples.
    for _ in range(PASSES):
        phi, (minimum, _), _ = solved(compress(lib, few, weights))
        sigma = noise(residuals(lib, few, minimum.pi, phi), lib, phi.size)
        if floor is not None:
            sigma = np.maximum(sigma, floor.sigma)
        weights = weights_from(sigma, few.tau)
    statistics = problem.statistics(weights)
    phi, (minimum, _), _ = solved(statistics)
    # The autocorrelation of the residuals sets γ = κ s²/N_eff of the last pass.
    ratio = inflation(residuals(lib, train, minimum.pi, phi), weights)
    coloured = coloured_noise_of(lib, [train], statistics, weights)
    if floor is not None:
        ratio = max(ratio, floor.inflation)
        coloured = ColouredNoise(max(coloured.density, ratio), max(coloured.variance, 1.0))
    if centre is not None:  # the trust in a type is relative to all of the noise
        ratio = max(ratio, coloured.inflation)
    phi, (minimum, notes), held = solved(statistics, ratio, constraints)
    notes += notes_of(held, bounds, lib.joint_names, problem.friction_names)
    return Fit(
        pi=minimum.pi,
        phi=phi.reshape(train.shape),
        lam=lib.lam_from_pi(minimum.pi),
        status=f"converged: most probable consistent model, {minimum.steps} Newton steps"
        if minimum.converged
        else f"stopped after {minimum.steps} Newton steps, decrement {minimum.decrement:.1e}; the "
        "model is consistent, but check units and outliers of the torque",
        iterations=minimum.steps,
        notes=(*prior.notes, *notes),
        statistics=statistics,
        weights=weights,
        coloured_noise=coloured,
    )


def fit_with_prior(problem: Problem, prior: PriorFile | None = None) -> Fit:
    """Maximum a posteriori with κ and the linear priors of a file."""
    kappa = prior.kappa if prior and prior.kappa else CAD
    if prior is None:
        return fit_map(problem, kappa)
    fit = fit_map(problem, kappa, prior.constraints, prior.centre)
    if not prior.units:
        return fit
    note = (
        f"the inertial prior is that of {prior.units} units of the fleet, which differ by about "
        f"{significant(100 / np.sqrt(kappa))} %"
    )
    return replace(fit, notes=(note, *fit.notes))


MAP = Method(
    "map",
    "most probable consistent model given the URDF as a prior, one convex problem (default)",
    fit_with_prior,
    from_statistics=True,
    bounds_friction=True,
    takes_prior=True,
    is_most_probable=True,
)
