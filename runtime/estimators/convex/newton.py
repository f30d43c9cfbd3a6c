"""Damped Newton method for the maximum a posteriori: one smooth convex problem.

    min over π of  (‖A π − b‖² + ρ)/2N + Σ_k γ_k [tr(P0_k⁻¹ P_k) − log det P_k]
                   − Σ_c μ log(l_c − a_c·π)

The log-determinant keeps every P_k ≻ 0; the optional half-spaces a_c·π ≤ l_c and a subspace
π = o + Z z carry further priors. Steps: Jacobi scaling, Cholesky with a ridge on failure, Armijo
backtracking, no step out of the cone; the end is a Newton decrement below 1e-3 γ.

Where the minimum is far from the prior, continuation in γ follows. The cost over γ is
self-concordant: the damped Newton method needs a number of steps that grows with the decrease of
the cost in units of γ. From the centre of the prior to data that contradict it, as with an unknown
payload, this is thousands of steps. The minimisers at γ 3^K, …, 3 γ, γ are each a few steps from
the one before. Source: Nesterov & Nemirovskii 1994 for path following.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.regression.factor import Reduced
from runtime.library import Array
from runtime.library.parameters import N_PARAMETERS, link_columns

RATIO = 3.0
"""Ratio of neighbouring weights. The minimiser of one lies within the quadratic convergence of the
next; with 10, three of 20 logs with an unknown body of 3 kg ended without convergence."""
ARMIJO = 1e-4
"""Share of the predicted decrease that a step must reach."""
RIDGE, RIDGE_GROWTH, RIDGE_MOST = 1e-14, 10.0, 1e-2
"""First ridge on the scaled Hessian, its growth where Cholesky fails, and the largest one."""
DECREMENT = 1e-3
"""½ gᵀH⁻¹g at the end, in units of the smallest γ: the cost is then that close to its minimum."""
MOST_STEPS = 200
"""Limit of Newton steps; from the centre of the prior 5 to 8 are usual."""
MOST_HALVINGS = 60
"""Limit of halvings of one step."""


@dataclass(frozen=True, slots=True, eq=False)
class HalfSpaces:
    """Half-spaces a_c · π ≤ l_c, kept strictly by a logarithmic barrier."""

    rows: Array  # a, (c, 10 n)
    limits: Array  # l, (c,)
    weight: float  # μ of the logarithms

    def slack(self, pi: Array) -> Array:
        """Slack l − a π, (c,)."""
        return np.asarray(self.limits - self.rows @ pi)


@dataclass(frozen=True, slots=True, eq=False)
class Subspace:
    """Affine subspace π = origin + basis z that linear equations leave free."""

    origin: Array  # (10 n,)
    basis: Array  # (10 n, free directions)


@dataclass(frozen=True, slots=True, eq=False)
class ConvexProblem:
    """Least squares over π with an entropic prior and optional linear constraints."""

    data: Reduced  # least squares over π
    prior: Prior  # entropic prior of all bodies
    gamma: Array  # weight γ of the prior per body, (n,), above 0
    inside: HalfSpaces | None = None  # half-spaces, or None
    free: Subspace | None = None  # subspace, or None

    def weighted(self, factor: float) -> "ConvexProblem":
        """The same problem with γ times a factor."""
        return replace(self, gamma=factor * self.gamma)


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """Minimiser of a convex problem with its optimality measure."""

    problem: ConvexProblem  # the problem that was solved
    pi: Array  # π, (10 n,), P_k ≻ 0
    loss: float  # L at π, without the share of the prior
    decrement: float  # ½ gᵀH⁻¹g, how far the cost is above its minimum, to second order
    steps: int  # Newton steps
    # whether the decrement is small enough; else π is the last point that was better
    converged: bool

    def hessian(self) -> Array:
        """Hessian of the whole cost at π, (10 n, 10 n)."""
        return _Cost(self.problem).slope(self.pi)[1]


def convex_problem(
    data: Reduced,
    prior: Prior,
    gamma: float | Array,
    inside: HalfSpaces | None = None,
    free: Subspace | None = None,
) -> ConvexProblem:
    """Return the problem of these parts, after checking that they fit together.

    data (m, 10 n), gamma (n,).
    """
    bodies = prior.centre.size // N_PARAMETERS
    weights = np.broadcast_to(np.asarray(gamma, dtype=float), (bodies,)).copy()
    if data.factor.shape != (data.target.size, prior.centre.size):
        raise IdentificationError(
            f"expected a factor of {data.target.size} rows and {prior.centre.size} columns, "
            f"got {data.factor.shape}; data and prior must be of the same bodies"
        )
    whole = [data.factor, data.target, np.array([data.rest, data.count]), weights]
    if not all(np.isfinite(a).all() for a in whole) or not (weights > 0).all() or data.count <= 0:
        raise IdentificationError(
            "expected finite statistics of at least one sample and a prior weight γ above 0; "
            "check the data for NaN and the weights for zeros"
        )
    return ConvexProblem(data, prior, weights, inside, free)


def minimise(
    problem: ConvexProblem, start: Array | None = None, most_steps: int = MOST_STEPS
) -> Minimum:
    """Minimise a convex problem by damped Newton steps."""
    cost = _Cost(problem)
    pi = np.array(problem.prior.centre if start is None else start, dtype=float)
    value = cost.value(pi)
    if value is None:
        raise IdentificationError(
            "the start of the convex problem lies outside its domain (a link is not physically "
            "consistent, or a linear prior is violated); start from the centre of the prior"
        )
    goal = DECREMENT * float(problem.gamma.min())
    # A cost whose digits end above the goal can still be solved to its last digit.
    goal = max(goal, 4 * np.finfo(float).eps * abs(value))
    decrement, steps, converged = np.inf, 0, False
    while steps < most_steps and not converged:
        # δ = −H⁻¹ g; ½ gᵀ H⁻¹ g is how far the cost is above its minimum, to second order.
        gradient, hessian = cost.slope(pi)
        step = -_solved(hessian, gradient, problem.free)
        decrement = -float(gradient @ step) / 2
        converged = decrement < goal
        # Without a step that lowers the cost, rounding has been reached.
        moved = None if converged else cost.search(pi, step, value, decrement)
        if moved is None:
            break
        pi, value = moved
        steps += 1
    return Minimum(problem, pi, problem.data.value(pi), decrement, steps, converged)


class _Cost:
    """Value, gradient, Hessian and line search of one problem."""

    def __init__(self, problem: ConvexProblem) -> None:
        self.problem = problem
        data = problem.data
        self.gram = data.factor.T @ data.factor / data.count
        self.per_parameter = np.repeat(problem.gamma, N_PARAMETERS)
        self.linear = self.per_parameter * problem.prior.slope

    def value(self, pi: Array) -> float | None:
        """Cost at π; None outside of the domain."""
        p = self.problem
        logs = p.prior.bodies.log_det(pi)
        if logs is None:
            return None
        value = p.data.value(pi) + float(self.linear @ pi - p.gamma @ logs)
        if p.inside is not None:
            slack = p.inside.slack(pi)
            if not (slack > 0).all():
                return None
            value -= p.inside.weight * float(np.log(slack).sum())
        return value

    def slope(self, pi: Array) -> tuple[Array, Array]:
        """Gradient (10 n,) and Hessian (10 n, 10 n) of the cost inside of the domain."""
        p = self.problem
        traces, blocks = p.prior.bodies.curvature(pi)
        # Through the residual: G π − g of normal equations would cancel half of the digits.
        residual = p.data.factor @ pi - p.data.target
        gradient = residual @ p.data.factor / p.data.count + self.linear
        gradient -= self.per_parameter * traces.ravel()
        # The prior couples the ten parameters of one body only.
        hessian = self.gram.copy()
        for k, block in enumerate(blocks):
            at = link_columns(k)
            hessian[at, at] += p.gamma[k] * block
        # Barrier −μ Σ log s_c: gradient μ Σ a_c/s_c, Hessian μ Σ a_c a_cᵀ/s_c².
        if p.inside is not None:
            push = p.inside.rows / p.inside.slack(pi)[:, None]
            gradient = gradient + p.inside.weight * push.sum(axis=0)
            hessian += p.inside.weight * push.T @ push
        return gradient, hessian

    def search(
        self, pi: Array, step: Array, value: float, decrement: float
    ) -> tuple[Array, float] | None:
        """First of 1, ½, ¼, … of the step that is inside and lowers the cost by Armijo's rule."""
        share = 1.0
        for _ in range(MOST_HALVINGS):
            tried = pi + share * step
            cost = self.value(tried)
            if cost is not None and cost <= value - ARMIJO * share * 2 * decrement:
                return tried, cost
            share /= 2
        return None


def _solved(hessian: Array, gradient: Array, free: Subspace | None) -> Array:
    """H⁻¹ g within the subspace; Jacobi scaling, with a ridge where Cholesky fails."""
    if free is not None:
        inner = free.basis.T @ hessian @ free.basis
        return np.asarray(free.basis @ _solved(inner, free.basis.T @ gradient, None))
    # Unit diagonal: kg, kg·m and kg·m² differ by orders of magnitude.
    scale = 1 / np.sqrt(np.diagonal(hessian))
    scaled = hessian * np.outer(scale, scale)
    eye, ridge = np.eye(len(scaled)), 0.0
    while True:
        try:
            factor = cho_factor(scaled + ridge * eye, lower=True, check_finite=False)
            return np.asarray(scale * cho_solve(factor, scale * gradient, check_finite=False))
        except np.linalg.LinAlgError:
            if ridge > RIDGE_MOST:
                raise IdentificationError(
                    "the Hessian of the convex problem is singular even with a ridge; check the "
                    "units of the torque and the weights"
                ) from None
            ridge = ridge * RIDGE_GROWTH or RIDGE


def factors(problem: ConvexProblem, start: Array) -> Array:
    """Falling factors on γ, from one at which `start` is nearly the minimiser down to 1.

    start (10 n,) → (count,).
    """
    data = problem.data
    gradient, hessian = _Cost(problem).slope(start)
    barrier = hessian - data.factor.T @ data.factor / data.count
    # B = γ ∇² of the prior; at s γ, s = √(gᵀ B⁻¹ g / γ), the Newton decrement is 1 or less.
    size = float(gradient @ np.linalg.lstsq(barrier, gradient)[0])
    far = np.sqrt(max(size / float(problem.gamma.min()), 1.0))
    count = int(np.ceil(np.log(far) / np.log(RATIO)))
    return np.asarray(RATIO ** np.arange(count, -1, -1.0))


def minimise_anywhere(problem: ConvexProblem, start: Array | None = None) -> Minimum:
    """Minimise a convex problem by Newton's method, by continuation where it does not converge."""
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
    costs = [_Cost(m.problem).value(m.pi) for m in (direct, continued)]
    values = [np.inf if cost is None else cost for cost in costs]
    return direct if values[0] <= values[1] else continued
