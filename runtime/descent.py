"""λ-Adam: the same descent as a compiled loop, or step by step in NumPy as its reference.

Both minimise L(x), x = [λ, ψ], on mini-batches or on compressed statistics, validate on held-out
samples and keep the best point; the compiled loop is the default where the library has one.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from runtime.library import Array, Batches, CompiledAdam, Quadratic
from runtime.library.adam import DIVERGED
from runtime.objective import TorqueObjective
from runtime.optimizers import AdamOptions, Outcome, Status, StoppingRule, Trace, minimise
from runtime.problem import Problem
from runtime.statistics import CompressedObjective, Statistics, compress

CHUNK = 500
"""Iterations between two looks at progress and Ctrl-C."""


@dataclass(frozen=True, slots=True)
class Preset:
    """Settings of the λ-Adam method; batch None takes all samples at every iteration."""

    adam: AdamOptions
    rule: StoppingRule
    batch: int | None


def descend(
    problem: Problem, objective: TorqueObjective, statistics: Statistics, x0: Array, preset: Preset
) -> Outcome:
    """Descend from x0 by the compiled loop if there is one, else by the reference."""
    if problem.lib.compiled_adam is None:
        return descend_by_steps(problem, objective, statistics, x0, preset)
    return _descend_compiled(problem, objective, statistics, x0, preset)


def descend_by_steps(
    problem: Problem, objective: TorqueObjective, statistics: Statistics, x0: Array, preset: Preset
) -> Outcome:
    """The reference: one NumPy step at a time."""
    held = TorqueObjective(problem.lib, problem.validation, problem.weights, objective.unit)
    if preset.batch is None:
        value_gradient = CompressedObjective(objective, statistics).value_gradient
    else:
        rng, size, batch = np.random.default_rng(problem.seed), len(problem.train), preset.batch

        def value_gradient(x: Array) -> tuple[float, Array]:
            return objective.value_gradient(x, rng.integers(0, size, batch))

    return minimise(x0, value_gradient, held.value, preset.adam, preset.rule, problem.progress)


def _descend_compiled(
    problem: Problem, objective: TorqueObjective, statistics: Statistics, x0: Array, preset: Preset
) -> Outcome:
    lib, rule, train = problem.lib, preset.rule, problem.train
    held = compress(lib, problem.validation, problem.weights)
    batches = None
    if preset.batch is not None:
        batches = Batches(
            preset.batch,
            train.q,
            train.dq,
            train.ddq,
            train.tau,
            train.columns,
            problem.weights,
            objective.unit,
        )
    job = lib.adam(
        x0,
        _quadratic(statistics, objective.unit),
        _quadratic(held, objective.unit),
        {
            "rate": preset.adam.learning_rate,
            "beta1": preset.adam.beta1,
            "beta2": preset.adam.beta2,
            "epsilon": preset.adam.epsilon,
            "threshold": rule.threshold,
            "validate_every": rule.validate_every,
            "patience": rule.patience,
        },
        rule.max_iterations // rule.validate_every + 1,
        batches,
    )
    rng = np.random.default_rng(problem.seed)
    status = _run(job, rule, problem.progress, rng, len(train), preset.batch)
    validated = np.arange(1, job.traced + 1) * rule.validate_every
    trace = Trace(
        tuple(validated.tolist()),
        tuple(job.training_trace[: job.traced].tolist()),
        tuple(job.held_trace[: job.traced].tolist()),
    )
    return Outcome(job.result(), job.best, job.step, status, trace)


def _run(
    job: CompiledAdam,
    rule: StoppingRule,
    progress: Callable[[int, float], None] | None,
    rng: np.random.Generator,
    size: int,
    batch: int | None,
) -> Status:
    """Run the job piece by piece until it ends."""
    try:
        while job.step < rule.max_iterations:
            count = min(CHUNK, rule.max_iterations - job.step)
            job.run(count, None if batch is None else rng.integers(0, size, (count, batch)))
            if progress is not None:
                progress(job.step, job.best)
            if job.finished:
                return Status.DIVERGED if job.finished == DIVERGED else Status.PATIENCE
    except KeyboardInterrupt:
        return Status.INTERRUPTED
    return Status.MAX_ITERATIONS


def _quadratic(statistics: Statistics, unit: Array) -> Quadratic:
    """The mean loss in y = [π; ψ]: H = RᵀR/N with the friction columns in units of ψ."""
    factor, n = statistics.over_pi(), statistics.n_samples
    scale = np.concatenate([np.ones(factor.shape[1] - unit.size), unit.ravel()])
    rows = factor * scale
    return Quadratic(
        rows.T @ rows / n,
        rows.T @ statistics.target / n,
        float(statistics.target @ statistics.target + statistics.rest) / (2 * n),
    )
