"""Damped Newton method for the maximum a posteriori: one smooth convex problem.

    min over π of  (‖A π − b‖² + ρ)/2N + Σ_k γ_k [tr(P0_k⁻¹ P_k) − log det P_k]
                   − Σ_c μ log(l_c − a_c·π)

The log-determinant keeps every P_k ≻ 0. Further priors are linear and named: equations, which leave
a subspace π = o + Z z, and half-spaces a_c·π ≤ l_c. Masses, centres of mass (m·c is linear where
c ∈ {c : n·c ≤ d} is n·(m c) ≤ d m) and symmetry planes are of this kind. A first point strictly
inside comes from one cone program; where there is none, its multipliers name the priors that
contradict each other (Farkas). Without linear priors the loop is compiled (`solve`).

Where the minimum is far from the prior, continuation in γ follows. The cost over γ is
self-concordant: the damped Newton method needs a number of steps that grows with the decrease of
the cost in units of γ, thousands from the prior to data that contradict it, as with an unknown
payload. The minimisers at γ 3^K, …, 3 γ, γ are each a few steps from the one before.
Source: Nesterov & Nemirovskii 1994 for path following.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import clarabel
import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, null_space
from scipy.sparse import csc_matrix

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
BARRIER = 1e-2  # weight of a half-space's logarithm over γ: small, only near points move
ROOM = 0.05  # largest distance of the first point from the constraints, in units of the prior
LEAST_ROOM = 1e-6  # distance below which no strictly consistent point exists
ROOM_COST = 1e4  # cost of missing distance from constraints, relative to distance from the prior
ACTIVE = 1e-2  # slack, relative to its scale, below which a half-space holds with equality


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
class ConvexProblem:
    """Least squares over π with an entropic prior and optional linear constraints."""

    data: Reduced  # least squares over π
    prior: Prior  # entropic prior of all bodies
    gamma: Array  # weight γ of the prior per body, (n,), above 0
    inside: HalfSpaces | None = None  # half-spaces, or None
    free: Array | None = None  # basis Z of what equations leave free, (10 n, directions), or None


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
    free: Array | None = None,
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


def _solved(hessian: Array, gradient: Array, free: Array | None) -> Array:
    """H⁻¹ g within the subspace; Jacobi scaling, with a ridge where Cholesky fails."""
    if free is not None:
        inner = free.T @ hessian @ free
        return np.asarray(free @ _solved(inner, free.T @ gradient, None))
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
        stage = minimise(replace(problem, gamma=float(factor) * problem.gamma), at)
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


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintRow:
    """One linear prior, coefficients · π = value or ≤ value."""

    name: str  # entry of the file that states it
    coefficients: Array  # (10 n,)
    value: float  # kg, kg·m or kg·m², as the coefficients require


@dataclass(frozen=True, slots=True)
class Constraints:
    """Linear priors: equations, and upper bounds."""

    equations: tuple[ConstraintRow, ...] = ()
    bounds: tuple[ConstraintRow, ...] = ()


def constrained(
    constraints: Constraints, data: Reduced, prior: Prior, gamma: float | Array
) -> tuple[Minimum, tuple[str, ...]]:
    """Minimise under entropic and linear priors."""
    # W with Wᵀ W the curvature of the prior: ‖W (π − π0)‖² / 2 is D to second order.
    _, blocks = prior.bodies.curvature(prior.centre)
    whiten = np.asarray(block_diag(*(np.linalg.cholesky(b).T for b in blocks)))
    start = _inside(constraints, prior, whiten)
    rows, limits = _stacked(constraints.bounds, start.size)
    inside = HalfSpaces(rows, limits, BARRIER * float(np.min(gamma))) if len(rows) else None
    free = None
    if constraints.equations:
        matrix, _ = _stacked(constraints.equations, start.size)
        scaled = np.asarray(np.linalg.solve(whiten.T, matrix.T).T)  # E in whitened unknowns
        free = np.asarray(np.linalg.solve(whiten, null_space(scaled)))
    problem = convex_problem(data, prior, gamma, inside, free)
    minimum = minimise_anywhere(problem, start)
    notes: tuple[str, ...] = ()
    if len(rows):
        scale = np.linalg.norm(np.linalg.solve(whiten.T, rows.T), axis=0)
        tight = (limits - rows @ minimum.pi) < ACTIVE * scale
        names = dict.fromkeys(b.name for b, t in zip(constraints.bounds, tight, strict=True) if t)
        if names:
            notes = (
                f"the estimate lies at the limit of the prior on {', '.join(names)}; check it",
            )
    return minimum, notes


def _inside(constraints: Constraints, prior: Prior, whiten: Array) -> Array:
    """Point near the centre of the prior, strictly inside: min d − ROOM_COST t, t ≤ ROOM.

    Unknowns are x of π = centre + W⁻¹ x in units of the prior, the distance t from all
    constraints, and d ≥ ‖x‖.
    """
    size = prior.centre.size
    e, e_value = _stacked(constraints.equations, size)
    a, limit = _stacked(constraints.bounds, size)
    # π = centre + back x, x in units of the prior
    back = np.asarray(np.linalg.inv(whiten), dtype=np.float64)
    a_x, e_x = a @ back, e @ back
    scale, length = np.linalg.norm(a_x, axis=1), np.linalg.norm(e_x, axis=1)
    if (scale == 0).any() or (length == 0).any():
        raise IdentificationError(
            "a prior has coefficients that are all zero, so it restricts no parameter; correct its "
            "numbers"
        )
    zero = np.zeros
    cone, room = _consistency(prior, back)
    # Rows b − A x ∈ K: equations, bounds with distance t, t ≤ ROOM, ‖x‖ ≤ d, P̃_k ⪰ t.
    blocks = [
        np.hstack([e_x / length[:, None], zero((len(e), 2))]),
        np.hstack([a_x / scale[:, None], np.ones((len(a), 1)), zero((len(a), 1))]),
        np.hstack([zero((1, size)), [[1.0, 0.0]]]),
        np.hstack([zero((1, size + 1)), [[-1.0]]]),
        np.hstack([-np.eye(size), zero((size, 2))]),
        np.hstack([-cone, room[:, None], zero((len(cone), 1))]),
    ]
    at = prior.centre
    sides = [(e_value - e @ at) / length, (limit - a @ at) / scale, [ROOM], zero(size + 1), room]
    bodies = size // N_PARAMETERS
    cones = [clarabel.ZeroConeT(len(e))] if len(e) else []
    cones += [clarabel.NonnegativeConeT(len(a) + 1), clarabel.SecondOrderConeT(size + 1)]
    cones += [clarabel.PSDTriangleConeT(4)] * bodies
    cost, matrix = np.concatenate([zero(size), [-ROOM_COST, 1.0]]), csc_matrix(np.vstack(blocks))
    solution = solved_cone(cost, matrix, np.concatenate(sides), cones)
    status, x = str(solution.status), np.array(solution.x)
    if status not in {"Solved", "AlmostSolved"} or x[size] < LEAST_ROOM:
        _contradiction(constraints, np.abs(np.array(solution.z)))
    return np.asarray(prior.centre + back @ x[:size])


def _contradiction(constraints: Constraints, multipliers: Array) -> None:
    """Raise with the priors whose multipliers prove that no point satisfies all of them."""
    rows = (*constraints.equations, *constraints.bounds)
    shares = multipliers[: len(rows)]
    guilty = shares > 1e-3 * max(float(shares.max()), 1e-300)
    names = list(dict.fromkeys(r.name for r, g in zip(rows, guilty, strict=True) if g))
    what = f"the prior on {names[0]} cannot hold"
    if len(names) > 1:
        what = f"the priors on {' and '.join(names)} contradict each other"
    raise IdentificationError(
        f"{what}: no physically consistent bodies satisfy them; correct or remove one of them"
    )


def _consistency(prior: Prior, back: Array) -> tuple[Array, Array]:
    """svec of P̃_k(x) = L⁻¹ P_k(back x) L⁻ᵀ with P0 = L Lᵀ, and of the identity, stacked."""
    basis, size = prior.bodies.basis, prior.centre.size
    lower = np.linalg.inv(np.linalg.cholesky(prior.bodies.pseudo_inertia(prior.centre)))
    blocks = [svec(inverse @ basis @ inverse.T) for inverse in lower]
    unit = np.tile(svec(np.eye(4)[None])[:, 0], size // N_PARAMETERS)
    return block_diag(*blocks) @ back, unit


def svec(matrices: Array) -> Array:
    """Upper triangles (10, k) of symmetric matrices (k, 4, 4), √2 beside the diagonal."""
    places = [(i, j) for j in range(4) for i in range(j + 1)]
    return np.array([(1.0 if i == j else np.sqrt(2.0)) * matrices[:, i, j] for i, j in places])


def solved_cone(cost: Array, rows: csc_matrix, sides: Array, cones: list[Any], **how: Any) -> Any:
    """Clarabel's solution of min cost · x with sides − rows x in a product of cones."""
    settings = clarabel.DefaultSettings()
    for name, value in ({"verbose": False} | how).items():
        setattr(settings, name, value)
    flat = csc_matrix((cost.size, cost.size))
    return clarabel.DefaultSolver(flat, cost, rows, sides, cones, settings).solve()


def _stacked(rows: tuple[ConstraintRow, ...], size: int) -> tuple[Array, Array]:
    """Coefficients (rows, size) and values (rows,)."""
    matrix = np.array([r.coefficients for r in rows]).reshape(len(rows), size)
    return matrix, np.array([r.value for r in rows])
