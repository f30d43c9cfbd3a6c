"""Descents in λ by compiled loops, or step by step in NumPy as their reference.

All minimise L(x), x = [λ, ψ]. Adam goes over mini-batches or compressed statistics, validates on
validation samples and keeps the best point; Levenberg–Marquardt goes down to the minimum of the
training loss. The compiled loops are the default where the library has them. Many problems are one
call.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.estimators.optimizers import (
    Adam,
    AdamOptions,
    LevenbergMarquardt,
    LevenbergOptions,
    Outcome,
    Status,
    StoppingRule,
    Trace,
    descend_traced,
    descend_validated,
    trace_of,
)
from runtime.estimators.problem import Problem
from runtime.estimators.regression import CompressedObjective, Statistics
from runtime.estimators.regression.torque_objective import TorqueObjective
from runtime.library import AdamProblem, Array, CompiledAdam, LeastSquares
from runtime.library.compiled_descent import CONVERGED, DIVERGED, PATIENCE, STALLED

CHUNK = 500
"""Iterations between two reports of progress and checks for Ctrl-C."""

_STATUS = {
    0: Status.MAX_ITERATIONS,
    PATIENCE: Status.PATIENCE,
    DIVERGED: Status.DIVERGED,
    CONVERGED: Status.CONVERGED,
    STALLED: Status.STALLED,
}


@dataclass(frozen=True, slots=True)
class Preset:
    """Settings of the λ-Adam method.

    Attributes:
        adam: learning rate and decay of the moments.
        rule: when to stop.
        batch: samples drawn for every iteration; None takes all of them.
    """

    adam: AdamOptions
    rule: StoppingRule
    batch: int | None


@dataclass(frozen=True, slots=True)
class Watch:
    """Observer of running descents.

    Attributes:
        every: iterations between two calls.
        seen: called with the iterations done and the current x of every descent; where one has
            ended it stays at its last iterate.
    """

    every: int
    seen: Callable[[int, list[Array]], None]


@dataclass(frozen=True, slots=True)
class Descent:
    """Problem with its objective, its compressed training and validation samples, and a start.

    x0 = [λ, ψ], or [θ, ψ] with log-Cholesky coordinates θ where `cholesky` is set.
    """

    problem: Problem
    objective: TorqueObjective
    statistics: Statistics
    validation: Statistics
    x0: Array
    cholesky: bool = False

    def bodies(self, x: Array) -> Array:
        """π (10 n,) at x."""
        lib, bodies = self.problem.lib, x[: self.objective.n_lam]
        return lib.pi_from_cholesky(bodies) if self.cholesky else lib.pi_from_lam(bodies)

    def validation_loss(self, x: Array) -> float:
        """Loss of the validation samples at x."""
        return self.validation.value(self.bodies(x), self.objective.split(x)[1])


def descent_of(
    problem: Problem, objective: TorqueObjective, x0: Array, cholesky: bool = False
) -> Descent:
    """Descent from x0 with the compressed samples that it needs.

    Args:
        problem: samples, weights and first guess.
        objective: torque loss over the training samples.
        x0: first point, (10 n + n k,).
        cholesky: whether x0 begins with log-Cholesky coordinates.

    Returns:
        The descent.
    """
    return Descent(
        problem, objective, problem.statistics(), problem.validation_statistics(), x0, cholesky
    )


def descend(descent: Descent, preset: Preset) -> Outcome:
    """Descend by Adam, in the compiled loop if there is one, else by the reference.

    Args:
        descent: problem and start.
        preset: settings.

    Returns:
        The point of the lowest validation loss.
    """
    if not descent.problem.lib.descends:
        return descend_by_steps(descent, preset)
    return descend_many([descent], preset)[0]


def descend_many(
    descents: Sequence[Descent],
    preset: Preset,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
    watch: Watch | None = None,
) -> list[Outcome]:
    """Descend by Adam on many problems of one robot, on threads, each as by `descend`.

    Args:
        descents: multi-start or Monte Carlo; a single one reports to the progress of its problem.
        preset: settings of all descents.
        threads: number of threads; the results do not depend on it.
        progress: called with the number of descents that have ended.
        watch: observer of the iterates; the compiled loop alone calls it.

    Returns:
        The outcomes, in order.
    """
    lib, rule, batch = descents[0].problem.lib, preset.rule, preset.batch
    if batch is not None and any(d.problem.train.coupling is not None for d in descents):
        # The compiled loop takes columns of one joint each.
        return [descend_by_steps(d, preset) for d in descents]
    options = {
        "rate": preset.adam.learning_rate,
        "beta1": preset.adam.beta1,
        "beta2": preset.adam.beta2,
        "epsilon": preset.adam.epsilon,
        "threshold": rule.threshold,
        "validate_every": rule.validate_every,
        "patience": rule.patience,
    }
    traces = rule.max_iterations // rule.validate_every + 1
    jobs = lib.adam([_adam_problem(d, batch) for d in descents], options, traces, batch or 0)
    draws = [np.random.default_rng(d.problem.seed) for d in descents]
    sizes = [len(d.problem.train) for d in descents]
    done, interrupted = 0, False
    try:
        while done < rule.max_iterations and not _ended(jobs):
            count = min(watch.every if watch else CHUNK, rule.max_iterations - done)
            rows = None
            if batch is not None:
                rows = [
                    rng.integers(0, size, (0 if job.finished else count, batch))
                    for rng, size, job in zip(draws, sizes, jobs, strict=True)
                ]
            jobs.run(count, rows, threads)
            done += count
            if watch is not None:
                watch.seen(done, [jobs.x(k) for k in range(len(jobs))])
            if len(jobs) == 1 and descents[0].problem.progress is not None:
                descents[0].problem.progress(jobs[0].step, jobs[0].best)
            if progress is not None:
                progress(sum(job.finished != 0 for job in jobs))
    except KeyboardInterrupt:
        interrupted = True
    # Ctrl-C in the piece that ends the last descent would otherwise be lost.
    stopped = [interrupted and (job.finished == 0 or _ended(jobs)) for job in jobs]
    return [_adam_outcome(jobs, k, rule, each) for k, each in enumerate(stopped)]


def descend_by_steps(descent: Descent, preset: Preset) -> Outcome:
    """Descend by the reference of Adam, one NumPy step at a time.

    Args:
        descent: problem and start.
        preset: settings.

    Returns:
        The point of the lowest validation loss.
    """
    problem, objective = descent.problem, descent.objective
    validated = TorqueObjective(problem.lib, problem.validation, problem.weights, objective.unit)
    if preset.batch is None:
        value_gradient = CompressedObjective(objective, descent.statistics).value_gradient
    else:
        rng, size, batch = np.random.default_rng(problem.seed), len(problem.train), preset.batch

        def value_gradient(x: Array) -> tuple[float, Array]:
            return objective.value_gradient(x, rng.integers(0, size, batch))

    adam = Adam(value_gradient, preset.adam)
    return descend_validated(adam, descent.x0, validated.value, preset.rule, problem.progress)


def levenberg_descend(descent: Descent, options: LevenbergOptions) -> Outcome:
    """Descend by Levenberg–Marquardt, in the compiled loop if there is one, else by the reference.

    Args:
        descent: problem and start.
        options: damping and tolerances.

    Returns:
        The last point.
    """
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
    status = Status.INTERRUPTED if interrupted else _STATUS[job.finished]
    validated = descent.validation_loss(x) if np.isfinite(job.loss) else np.inf
    return Outcome(x, validated, job.step, status, trace_of(trace))


def levenberg_by_steps(descent: Descent, options: LevenbergOptions) -> Outcome:
    """Descend by the reference of Levenberg–Marquardt, one NumPy step at a time.

    Args:
        descent: problem and start.
        options: damping and tolerances.

    Returns:
        The last point.
    """
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


def least_squares(statistics: Statistics, unit: Array) -> LeastSquares:
    """Mean loss in y = [β; ψ] with a triangular factor.

    Args:
        statistics: compressed samples.
        unit: φ = ψ · unit, (n, k).

    Returns:
        Factor, target, ρ and scale in y.
    """
    scale = 1 / (2 * statistics.n_samples)
    if not unit.size:  # the factor over β alone is triangular already
        return LeastSquares(statistics.factor, statistics.target, statistics.rest, scale)
    columns = statistics.factor.copy()
    columns[:, statistics.n_base :] *= unit.ravel()
    width = len(statistics.target)
    rows = np.column_stack([columns, statistics.target])
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    return LeastSquares(triangle[:, :width], triangle[:, width], statistics.rest, scale)


def _adam_problem(descent: Descent, batch: int | None) -> AdamProblem:
    problem, unit = descent.problem, descent.objective.unit
    samples = None
    if batch is not None:
        s = problem.train
        columns = (s.columns * unit).reshape(len(s), -1)
        samples = np.hstack([s.q, s.dq, s.ddq, s.tau, columns])
    return AdamProblem(
        descent.x0,
        least_squares(descent.statistics, unit),
        least_squares(descent.validation, unit),
        samples,
        problem.weights,
    )


def _ended(jobs: CompiledAdam) -> bool:
    return all(job.finished for job in jobs)


def _adam_outcome(jobs: CompiledAdam, k: int, rule: StoppingRule, interrupted: bool) -> Outcome:
    job = jobs[k]
    status = Status.INTERRUPTED if interrupted else _STATUS[job.finished]
    validated = np.arange(1, job.traced + 1) * rule.validate_every
    trace = Trace(
        tuple(validated.tolist()),
        tuple(jobs.training_trace[k, : job.traced].tolist()),
        tuple(jobs.held_trace[k, : job.traced].tolist()),
    )
    return Outcome(jobs.best_x(k), float(job.best), int(job.step), status, trace)
