"""Adam descents in λ: the compiled loop, or NumPy steps as its reference.

Both minimise L(x), x = [λ, ψ], over mini-batches or compressed statistics, validate on validation
samples and keep the best point. The compiled loop is the default where the library has one. Many
problems are one call.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.estimators.descent.descent import STATUS, Descent, least_squares
from runtime.estimators.optimizers import AdamOptions, Outcome, Status, StoppingRule, Trace, adam
from runtime.estimators.regression.factor import CompressedObjective, TorqueObjective
from runtime.library import Array
from runtime.library.compiled_descent import AdamProblem, CompiledAdam

__all__ = ["Preset", "Watch"]

CHUNK = 500
"""Iterations between two reports of progress and checks for Ctrl-C."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Watch:
    """Observer of running descents."""

    every: int  # iterations between two calls
    # called with the iterations done and the current x of every descent; where one has ended it
    # stays at its last iterate
    seen: Callable[[int, list[Array]], None]


def descend(descent: Descent, preset: Preset) -> Outcome:
    """Descend by Adam, in the compiled loop if there is one, else by the reference."""
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
    """Descend by Adam on many problems of one robot, on threads, each as by `descend`."""
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
    problems = [_adam_problem(d, batch) for d in descents]
    jobs = CompiledAdam(lib.binding, problems, options, traces, batch or 0)
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
    """Descend by the reference of Adam, one NumPy step at a time."""
    problem, objective = descent.problem, descent.objective
    validated = TorqueObjective(problem.lib, problem.validation, problem.weights, objective.unit)
    if preset.batch is None:
        value_gradient = CompressedObjective(objective, descent.statistics).value_gradient
    else:
        rng, size, batch = np.random.default_rng(problem.seed), len(problem.train), preset.batch

        def value_gradient(x: Array) -> tuple[float, Array]:
            return objective.value_gradient(x, rng.integers(0, size, batch))

    rule, options = preset.rule, preset.adam
    return adam(value_gradient, options, descent.x0, validated.value, rule, problem.progress)


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
    status = Status.INTERRUPTED if interrupted else STATUS[job.finished]
    validated = np.arange(1, job.traced + 1) * rule.validate_every
    trace = Trace(
        tuple(validated.tolist()),
        tuple(jobs.training_trace[k, : job.traced].tolist()),
        tuple(jobs.held_trace[k, : job.traced].tolist()),
    )
    return Outcome(jobs.best_x(k), float(job.best), int(job.step), status, trace)
