"""A descent: problem, compressed samples, and a start; and those by second-order methods.

Levenberg–Marquardt in λ or θ is a compiled loop. Newton's method in log-Cholesky coordinates θ
takes the last steps to the boundary of consistency, and all steps where a library has no such loop:

    H = JᵀJ + Σ_k ∂(∂π_k/∂θ_kᵀ g_k)/∂θ_k,   g = ∂L/∂π

Levenberg–Marquardt drops the second term, which is the whole curvature next to the boundary, where
semi-axes tend to 0: hundreds of its steps do not converge. With the term every step lowers the
distance by a factor. λ is not used there: where two semi-axes are 0, the angle between them has no
effect, and such points hold back a descent.
Source: Nocedal & Wright 2006, Ch. 3 (modified Newton) and Ch. 10 (large residuals).
"""

from dataclasses import asdict, dataclass

import numpy as np

from runtime.estimators.optimizers import LevenbergOptions, Outcome, Status, trace_of
from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import Statistics, TorqueObjective
from runtime.library import Array
from runtime.library.compiled_descent import (
    CONVERGED,
    DIVERGED,
    PATIENCE,
    STALLED,
    CompiledLevenberg,
    LeastSquares,
)

NEWTON_STEPS = 600  # most Newton steps; usual are 10 to 60, 400 at links on the boundary
DECREASE = 1e-8
"""Predicted decrease of L, relative, below which the descent has converged. The loss is then within
some 1e-6 of its minimum, while noise moves it by 1/√N."""
DIFFERENCE = 1e-5
"""Step of central differences, relative to the coordinate, which counts as 1e-3 at least. The error
of J is then 1e-10."""
ARMIJO = 1e-4  # share of the predicted decrease that a step must reach
_LEAST = 1e-14  # smallest curvature, relative to the largest
_HALVINGS = 30
STATUS = {  # why a compiled loop ended: number of the C code → status
    0: Status.MAX_ITERATIONS,
    PATIENCE: Status.PATIENCE,
    DIVERGED: Status.DIVERGED,
    CONVERGED: Status.CONVERGED,
    STALLED: Status.STALLED,
}


@dataclass(frozen=True, slots=True)
class Descent:
    """Problem with its objective, its compressed training and validation samples, and a start.

    x0 = [λ, ψ], or [θ, ψ] with log-Cholesky coordinates θ where `cholesky` is set. `unit` is the
    unit of mass of the problem, kg.
    """

    problem: Problem
    objective: TorqueObjective
    statistics: Statistics
    validation: Statistics
    x0: Array
    cholesky: bool = False
    unit: float = 1.0

    def bodies(self, x: Array) -> Array:
        """π (10 n,) at x."""
        lib, bodies = self.problem.lib, x[: self.objective.n_lam]
        return lib.pi_from_cholesky(bodies) if self.cholesky else lib.pi_from_lam(bodies)

    def validation_loss(self, x: Array) -> float:
        """Loss of the validation samples at x."""
        return self.validation.value(self.bodies(x), self.objective.split(x)[1])


def least_squares(statistics: Statistics, unit: Array) -> LeastSquares:
    """Mean loss in y = [β; ψ] with a triangular factor."""
    scale = 1 / (2 * statistics.n_samples)
    if not unit.size:  # the factor over β alone is triangular already
        return LeastSquares(statistics.factor, statistics.target, statistics.rest, scale)
    columns = statistics.factor.copy()
    columns[:, statistics.n_base :] *= unit.ravel()
    width = len(statistics.target)
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, statistics.target]), mode="r"))
    return LeastSquares(triangle[:, :width], triangle[:, width], statistics.rest, scale)


def levenberg_descend(descent: Descent, options: LevenbergOptions) -> Outcome:
    """Descend by Levenberg–Marquardt in the compiled loop; without one, stay at the start."""
    if not descent.problem.lib.descends:
        with np.errstate(all="ignore"):
            held = descent.validation_loss(descent.x0)
        status = Status.MAX_ITERATIONS if np.isfinite(held) else Status.DIVERGED
        return Outcome(descent.x0, held, 0, status, trace_of(()))
    problem, objective = descent.problem, descent.objective
    settings, binding = asdict(options), problem.lib.binding
    most = settings.pop("max_iterations")
    squares = least_squares(descent.statistics, objective.unit)
    jobs = CompiledLevenberg(binding, [descent.x0], [squares], settings, most, descent.cholesky)
    job, trace, interrupted = jobs[0], list[tuple[int, float, float]](), False
    try:
        while job.finished == 0 and job.step < most:
            accepted = job.traced
            jobs.run(1)
            if job.traced > accepted:
                trace.append((job.step, job.loss, descent.validation_loss(jobs.x(0))))
            if problem.progress is not None:
                problem.progress(job.step, job.loss)
    except KeyboardInterrupt:
        interrupted = True
    x = jobs.x(0)
    status = Status.INTERRUPTED if interrupted else STATUS[job.finished]
    validated = descent.validation_loss(x) if np.isfinite(job.loss) else np.inf
    return Outcome(x, validated, job.step, status, trace_of(trace))


def newton_descend(descent: Descent, start: Outcome) -> Outcome:
    """Go on from the end of another descent by Newton's method."""
    objective, x = _Loss(descent), start.x
    loss, status, step = objective.value(x), Status.MAX_ITERATIONS, 0
    trace = start.trace
    rows = list(zip(trace.iteration, trace.training, trace.validation, strict=True))
    try:
        while step < NEWTON_STEPS:
            move, predicted = _step(*objective.slope(x))
            if predicted <= DECREASE * loss:
                status = Status.CONVERGED
                break
            # Halve until the loss falls by a share of what the slope predicts (Armijo).
            sizes = 0.5 ** np.arange(_HALVINGS)
            tried = ((float(size), objective.value(x + size * move)) for size in sizes)
            better = next((s for s in tried if s[1] < loss - 2 * ARMIJO * s[0] * predicted), None)
            if better is None:
                status = Status.STALLED
                break
            x, loss, step = x + better[0] * move, better[1], step + 1
            rows.append((start.iterations + step, loss, descent.validation_loss(x)))
            if descent.problem.progress is not None:
                descent.problem.progress(start.iterations + step, loss)
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    validation = rows[-1][2] if step else start.validation
    return Outcome(x, validation, start.iterations + step, status, trace_of(rows))


def _step(gradient: Array, hessian: Array) -> tuple[Array, float]:
    """−|H|⁻¹ g and the decrease ½ gᵀ|H|⁻¹g: negative curvature is descended as positive is."""
    values, vectors = np.linalg.eigh(hessian)
    sizes = np.maximum(np.abs(values), _LEAST * max(float(np.abs(values).max()), 1e-300))
    along = vectors.T @ gradient
    return -vectors @ (along / sizes), float(np.sum(along**2 / sizes)) / 2


class _Loss:
    """L of compressed samples with gradient and Hessian in x = [θ, ψ]."""

    def __init__(self, descent: Descent) -> None:
        lib = descent.problem.lib
        self._descent = descent
        self._squares = least_squares(descent.statistics, descent.objective.unit)
        self._size = descent.problem.start.size
        self._jacobian = lib.cholesky_jacobian
        base = len(lib.base_matrix)
        self._over_pi = self._squares.factor[:, :base] @ lib.base_matrix
        self._over_psi = self._squares.factor[:, base:]

    def _residual(self, x: Array) -> Array:
        pi, psi = self._descent.bodies(x), x[self._size :]
        return np.asarray(self._over_pi @ pi + self._over_psi @ psi - self._squares.target)

    def value(self, x: Array) -> float:
        """L at x; infinite where it is not finite."""
        with np.errstate(all="ignore"):
            residual = self._residual(x)
            value = float(residual @ residual + self._squares.rest) * self._squares.scale
        return value if np.isfinite(value) else np.inf

    def slope(self, x: Array) -> tuple[Array, Array]:
        """Gradient and Hessian of L at x."""
        residual, size = self._residual(x), self._size
        bodies = x[:size]
        blocks = self._jacobian(bodies)
        links, width = blocks.shape[:2]
        over_pi = self._over_pi.reshape(-1, links, width)
        by_theta = np.einsum("rki,kij->rkj", over_pi, blocks).reshape(-1, size)
        jacobian = np.hstack([by_theta, self._over_psi])
        # Second term: ∂(∂π/∂θᵀ g)/∂θ of all links at once, one coordinate of each at a time; the
        # points ahead and behind in all coordinates are one batch.
        pull = (self._over_pi.T @ residual).reshape(links, width)
        hessian = jacobian.T @ jacobian
        theta = bodies.reshape(links, width)
        change = DIFFERENCE * np.maximum(np.abs(theta), 1e-3)
        moves = np.eye(width)[:, None] * change  # (coordinate, link, width)
        points = np.concatenate([theta + moves, theta - moves]).reshape(-1, size)
        pulled = np.einsum("nkij,ki->nkj", self._jacobian(points), pull)
        columns = (pulled[:width] - pulled[width:]) / (2 * change.T[:, :, None])
        for k in range(links):
            block = slice(k * width, (k + 1) * width)
            hessian[block, block] += columns[:, k].T
        hessian = (hessian + hessian.T) / 2
        factor = 2 * self._squares.scale
        return factor * (jacobian.T @ residual), factor * hessian
