"""Levenberg–Marquardt descents in λ or θ: the compiled loop, and NumPy steps as its reference."""

import numpy as np

from runtime.estimators.descent.descent import STATUS, Descent, least_squares
from runtime.estimators.optimizers import (
    LevenbergMarquardt,
    LevenbergOptions,
    Outcome,
    Status,
    descend_traced,
    trace_of,
)
from runtime.library import Array


def levenberg_descend(descent: Descent, options: LevenbergOptions) -> Outcome:
    """Descend by Levenberg–Marquardt, in the compiled loop if there is one, else in Python."""
    if not descent.problem.lib.descends:
        return levenberg_by_steps(descent, options)
    problem, objective = descent.problem, descent.objective
    settings = {
        "first_damping": options.first_damping,
        "step_tolerance": options.step_tolerance,
        "decrease_tolerance": options.decrease_tolerance,
    }
    squares = least_squares(descent.statistics, objective.unit)
    jobs = problem.lib.levenberg(
        [descent.x0], [squares], settings, options.max_iterations, descent.cholesky
    )
    job, trace, interrupted = jobs[0], list[tuple[int, float, float]](), False
    try:
        while job.finished == 0 and job.step < options.max_iterations:
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


def levenberg_by_steps(descent: Descent, options: LevenbergOptions) -> Outcome:
    """Descend by the reference of Levenberg–Marquardt, one NumPy step at a time."""
    problem, objective = descent.problem, descent.objective
    lib, squares = problem.lib, least_squares(descent.statistics, objective.unit)
    size = problem.start.size

    def residual_jacobian(x: Array) -> tuple[Array, Array]:
        # r = R y − r₀ with y = [K π(x); ψ], and J = R [K ∂π/∂x, 1] link by link.
        y = np.concatenate([lib.base_matrix @ descent.bodies(x), x[size:]])
        jacobian_of = lib.cholesky_jacobian if descent.cholesky else lib.pi_jacobian
        blocks = jacobian_of(x[:size])
        links, width = blocks.shape[:2]
        by_pi = lib.base_matrix.reshape(-1, links, width)
        by_lam = np.einsum("bki,kij->bkj", by_pi, blocks).reshape(len(by_pi), size)
        base = len(by_lam)
        jacobian = np.hstack([squares.factor[:, :base] @ by_lam, squares.factor[:, base:]])
        return squares.factor @ y - squares.target, jacobian

    optimiser = LevenbergMarquardt(residual_jacobian, options, squares.rest, squares.scale)
    return descend_traced(
        optimiser, descent.x0, descent.validation_loss, options.max_iterations, problem.progress
    )
