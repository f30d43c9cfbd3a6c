"""Continuation in γ for convex problems whose minimum is far from the prior.

The cost over γ is self-concordant: the damped Newton method needs a number of steps that grows with
the decrease of the cost in units of γ. From the centre of the prior to data that contradict it, as
with an unknown payload, this is thousands of steps. The minimisers at γ 3^K, …, 3 γ, γ are each a
few steps from the one before.
Source: Nesterov & Nemirovskii 1994 for path following.
"""

import numpy as np

from runtime.estimators.convex.newton import ConvexProblem, Minimum, cost_of, minimise, slope_of
from runtime.library import Array

RATIO = 3.0
"""Ratio of neighbouring weights. The minimiser of one lies within the quadratic convergence of the
next; with 10, three of 20 logs with an unknown body of 3 kg ended without convergence."""


def factors(problem: ConvexProblem, start: Array) -> Array:
    """Falling factors on γ, from one at which `start` is nearly the minimiser down to 1.

    start (10 n,) → (count,).
    """
    data = problem.data
    gradient, hessian = slope_of(problem, start)
    barrier = hessian - data.factor.T @ data.factor / data.count
    # B = γ ∇² of the prior; at s γ, s = √(gᵀ B⁻¹ g / γ), the Newton decrement is 1 or less.
    size = float(gradient @ np.linalg.lstsq(barrier, gradient)[0])
    far = np.sqrt(max(size / float(problem.gamma.min()), 1.0))
    count = int(np.ceil(np.log(far) / np.log(RATIO)))
    return np.asarray(RATIO ** np.arange(count, -1, -1.0))


def minimise_anywhere(problem: ConvexProblem, start: Array | None = None) -> Minimum:
    """Minimise a convex problem by Newton's method, by continuation where it does not converge.

    Args:
        problem: data, prior and constraints.
        start: first point, (10 n,), strictly inside; default is the centre of the prior.

    Returns:
        The minimiser; `converged` is False where continuation ended early, too.

    Raises:
        IdentificationError: the start is not strictly inside.
    """
    direct = minimise(problem, start)
    if direct.converged:
        return direct
    # With linear priors the centre of the entropic one may lie outside, and the start is taken.
    plain = problem.inside is None and problem.free is None
    at = problem.prior.centre if plain or start is None else start
    steps = direct.steps
    for factor in factors(problem, at):
        stage = minimise(problem.weighted(float(factor)), at)
        at, steps = stage.pi, steps + stage.steps
        if not stage.converged:
            break
    reached = Minimum(problem, at, stage.loss, stage.decrement, steps, stage.converged)
    return better(direct, reached)


def better(direct: Minimum, continued: Minimum) -> Minimum:
    """The minimum of the smaller cost; the continued one where it converged."""
    if continued.converged:
        return continued
    costs = [cost_of(m.problem, m.pi) for m in (direct, continued)]
    values = [np.inf if cost is None else cost for cost in costs]
    return direct if values[0] <= values[1] else continued
