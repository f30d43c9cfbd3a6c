"""Damped Newton method for the maximum a posteriori: one smooth convex problem.

    min over π of  (‖A π − b‖² + ρ)/2N + Σ_k γ_k [tr(P0_k⁻¹ P_k) − log det P_k]
                   − Σ_c μ log(l_c − a_c·π)

The log-determinant keeps every P_k ≻ 0; the optional half-spaces a_c·π ≤ l_c and a subspace
π = o + Z z carry further priors.

Where the minimum is far from the prior, continuation in γ follows. The cost over γ is
self-concordant: the damped Newton method needs a number of steps that grows with the decrease of
the cost in units of γ, thousands from the prior to data that contradict it, as with an unknown
payload. The minimisers at γ 3^K, …, 3 γ, γ are each a few steps from the one before.
Source: Nesterov & Nemirovskii 1994 for path following.

Without linear priors the loop is compiled (`solve`), and PC-IDIM-OLS is a path of falling γ,

    min ‖A π − b‖²  subject to  P_k ⪰ 0                                                   (Eq. 3.8)

The minimiser at weight γ satisfies ∇L = γ Σ_k (P_k⁻¹ − P0_k⁻¹) on P_k, so every consistent π with
Σ tr(P0_k⁻¹ P_k) no larger than the minimiser's has L(π) ≥ L(π_γ) − 4 n_links γ: the certificate.
The path starts where the prior dominates, and each minimiser starts the next. Without the trace
term of the prior the logarithm alone would have no minimiser. No cone solver is needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.regression.factor import Reduced
from runtime.library import Array, Library
from runtime.library.compiled_descent import CompiledConvex, ConvexAnswer, ConvexTask
from runtime.library.parameters import N_PARAMETERS, link_columns

RATIO = 3.0
"""Ratio of neighbouring weights. The minimiser of one lies within the quadratic convergence of the
next; with 10, three of 20 logs with an unknown body of 3 kg ended without convergence."""
ARMIJO = 1e-4  # share of the predicted decrease that a step must reach
RIDGE, RIDGE_GROWTH, RIDGE_MOST = 1e-14, 10.0, 1e-2
"""First ridge on the scaled Hessian, its growth where Cholesky fails, and the largest one."""
DECREMENT = 1e-3  # ½ gᵀH⁻¹g at the end over the smallest γ: the cost is that close to its minimum
MOST_STEPS = 200  # limit of Newton steps; from the centre of the prior 5 to 8 are usual
MOST_HALVINGS = 60


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
    converged: bool  # the decrement is small enough; else π is the last better point

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
    """Problem of parts that fit together: data (m, 10 n), gamma (n,) or one number."""
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


def minimise(problem: ConvexProblem, start: Array | None = None) -> Minimum:
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
    while steps < MOST_STEPS and not converged:
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
    """Falling factors on γ, from one at which `start` (10 n,) is nearly the minimiser down to 1."""
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
    return better(direct, Minimum(problem, at, stage.loss, stage.decrement, steps, stage.converged))


def better(direct: Minimum, continued: Minimum) -> Minimum:
    """The minimum of the smaller cost; the continued one where it converged."""
    if continued.converged:
        return continued
    costs = [_Cost(m.problem).value(m.pi) for m in (direct, continued)]
    values = [np.inf if cost is None else cost for cost in costs]
    return direct if values[0] <= values[1] else continued


SMALLEST_GAP = 1e-7  # certificate at the end of the path, relative to the loss
FIRST, SHRINK = 1e-1, 10.0  # γ at the start in units of the loss, and its ratio from step to step
PATIENCE = 60  # Newton steps per γ; more only where the optimum drifts to implausible bodies
EXPLAINED = 1e-9  # losses below this share of that of τ̂ = 0 count as rounding


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Minimisers at falling weights γ, towards the optimum of all consistent models."""

    gammas: Array  # weights, falling
    points: Array  # the minimisers π, one row each
    losses: Array  # L at them
    gap: float  # 4 n_links γ at the end plus the Newton decrement: L − L* is no larger
    weight: float  # Σ tr(P0_k⁻¹ P_k) / 4 n at the end: 1 at the prior, large for implausible bodies
    steps: int  # total number of Newton steps
    converged: bool  # whether the minimisation converged at every γ

    def nearest(self, slack: float, optimum: float | None = None) -> Array | None:
        """First point, so the nearest to the prior, within a relative slack of an optimum."""
        bar = float(self.losses[-1]) if optimum is None else optimum
        good = np.flatnonzero(self.losses <= (1 + slack) * bar)
        return np.array(self.points[good[0]]) if good.size else None


def gamma_sequence(data: Reduced, bodies: int, shrink: float = SHRINK) -> Array:
    """Falling weights γ, from `FIRST` of the unexplained loss down to a gap of `SMALLEST_GAP`."""
    # The unexplained loss sets the unit; where it is rounding, a share of the loss of τ̂ = 0 does.
    zero_torque = data.value(np.zeros(data.factor.shape[1]))
    unit = max(data.rest / (2 * data.count), EXPLAINED * zero_torque, 1e-300)
    # Certificate: the gap at the end is 4 n γ.
    last = SMALLEST_GAP * unit / (4 * bodies)
    count = int(np.ceil(np.log(FIRST * unit / last) / np.log(shrink))) + 1
    return np.geomspace(FIRST * unit, last, count)


def path_of(
    prior: Prior,
    gammas: Array,
    points: Array,
    losses: Array,
    decrement: float,
    steps: int,
    converged: bool,
) -> Path:
    """Path of given minimisers, with its certificate."""
    degree = 4 * (points.shape[1] // N_PARAMETERS)
    gap = degree * float(gammas[-1]) + decrement
    weight = float(prior.slope @ points[-1]) / degree
    return Path(gammas, points, losses, gap, weight, steps, converged)


def solve(lib: Library, problem: ConvexProblem, start: Array | None = None) -> Minimum:
    """Minimise a convex problem by the compiled Newton method, unless it has linear priors."""
    return solve_many(lib, [problem], [start])[0]


def solve_many(
    lib: Library,
    problems: Sequence[ConvexProblem],
    starts: Sequence[Array | None] | None = None,
    threads: int = 1,
) -> list[Minimum]:
    """Minimise many problems of one robot, for Monte Carlo."""
    firsts: list[Array | None] = list(starts or [None] * len(problems))
    plain = all(p.inside is None and p.free is None for p in problems)
    if not plain or not problems:
        return [minimise_anywhere(p, s) for p, s in zip(problems, firsts, strict=True)]
    tasks = [task_of(p, np.ones(1), s) for p, s in zip(problems, firsts, strict=True)]
    answers = CompiledConvex(lib.binding, tasks, DECREMENT, MOST_STEPS).run(threads)
    minima = [_minimum(p, answer) for p, answer in zip(problems, answers, strict=True)]
    return [_continued(lib, m, s) for m, s in zip(minima, firsts, strict=True)]


def follow_compiled(
    lib: Library, data: Reduced, prior: Prior, shrink: float = SHRINK, most_steps: int = PATIENCE
) -> Path:
    """Follow a path by the compiled Newton method."""
    bodies = prior.centre.size // N_PARAMETERS
    gammas = gamma_sequence(data, bodies, shrink)
    task = task_of(ConvexProblem(data, prior, np.ones(bodies)), gammas)
    (a,) = CompiledConvex(lib.binding, [task], DECREMENT, most_steps).run()
    ended, tried = float(a.decrements[-1]), gammas[: len(a.losses)]
    return path_of(prior, tried, a.points, a.losses, ended, int(a.steps.sum()), a.converged)


def _continued(lib: Library, minimum: Minimum, start: Array | None) -> Minimum:
    """The minimum, by continuation in γ where it has not converged."""
    problem = minimum.problem
    is_inside = start is None or problem.prior.bodies.log_det(start) is not None
    if minimum.converged or not is_inside:  # every body of the first point is consistent
        return minimum
    task = task_of(problem, factors(problem, problem.prior.centre))
    (answer,) = CompiledConvex(lib.binding, [task], DECREMENT, MOST_STEPS).run()
    return better(minimum, _minimum(problem, answer))


def task_of(problem: ConvexProblem, gammas: Array, start: Array | None = None) -> ConvexTask:
    """Task of the compiled descents, from the centre of the prior where no start is given."""
    data, prior = problem.data, problem.prior
    rows = data.factor, data.target, data.rest, data.count
    first = prior.centre if start is None else start
    return ConvexTask(*rows, prior.slope, problem.gamma, gammas, first)


def _minimum(problem: ConvexProblem, answer: ConvexAnswer) -> Minimum:
    loss, decrement = float(answer.losses[-1]), float(answer.decrements[-1])
    steps = int(answer.steps.sum())
    return Minimum(problem, answer.points[-1], loss, decrement, steps, answer.converged)
