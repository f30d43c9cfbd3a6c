"""Methods that descend in λ: from a `Problem` to a `Fit`, one at a time or many at once.

They minimise L(x), x = [λ, ψ], over mini-batches or compressed statistics, and keep the best point
of the validation samples. Adam is a compiled loop; NumPy steps are its reference.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from runtime.common.threads import cores, one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.descent.descent import (
    STATUS,
    Descent,
    least_squares,
    levenberg_descend,
    newton_descend,
)
from runtime.estimators.methods import Method
from runtime.estimators.optimizers import (
    AdamOptions,
    LevenbergOptions,
    Outcome,
    Status,
    StoppingRule,
    Trace,
    adam,
)
from runtime.estimators.problem import Fit, Problem, best_friction, in_unit, mass_unit
from runtime.estimators.regression.factor import CompressedObjective, TorqueObjective, compress_all
from runtime.library import Array, Library
from runtime.library.compiled_descent import AdamProblem, CompiledAdam

CHUNK = 500  # iterations between two reports of progress and checks for Ctrl-C


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
    """Descend by Adam on one problem."""
    return descend_many([descent], preset)[0]


def descend_many(
    descents: Sequence[Descent], preset: Preset, threads: int = 1, watch: Watch | None = None
) -> list[Outcome]:
    """Descend by Adam on many problems of one robot, on threads, or by the reference."""
    lib, rule, batch = descents[0].problem.lib, preset.rule, preset.batch
    are_coupled = any(d.problem.train.coupling is not None for d in descents)
    if not lib.descends or (batch is not None and are_coupled):
        # No compiled loop, or columns of several joints, which it does not take.
        return [descend_by_steps(d, preset) for d in descents]
    options = asdict(rule) | asdict(preset.adam)
    options["rate"] = options.pop("learning_rate")
    traces = options.pop("max_iterations") // rule.validate_every + 1
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
        samples = np.hstack([s.q, s.dq, s.ddq, s.tau, (s.columns * unit).reshape(len(s), -1)])
    parts = descent.statistics, descent.validation
    training, held = (least_squares(each, unit) for each in parts)
    return AdamProblem(descent.x0, training, held, samples, problem.weights)


def _ended(jobs: CompiledAdam) -> bool:
    return all(job.finished for job in jobs)


def _adam_outcome(jobs: CompiledAdam, k: int, rule: StoppingRule, interrupted: bool) -> Outcome:
    job = jobs[k]
    status = Status.INTERRUPTED if interrupted else STATUS[job.finished]
    validated = np.arange(1, job.traced + 1) * rule.validate_every
    losses = (each[k, : job.traced] for each in (jobs.training_trace, jobs.held_trace))
    trace = Trace(*(tuple(each.tolist()) for each in (validated, *losses)))
    return Outcome(jobs.best_x(k), float(job.best), int(job.step), status, trace)


PRESETS = {
    "simulation": Preset(AdamOptions(1e-3), StoppingRule(1500, 25), 64),
    "real": Preset(AdamOptions(1e-4), StoppingRule(2500, 25), 64),
    "full": Preset(AdamOptions(1e-3), StoppingRule(20000, 200, threshold=1e-8), None),
}

THINNEST_AXIS = 1e-6
"""Σ_com eigenvalues below this fraction of the trace are raised to it after a descent in λ:
sign-normalised steps can carry a, b or c through 0, where P is singular."""


def in_batches(preset: str | Preset | None) -> bool:
    """Whether Adam draws mini-batches with these settings; by default it takes all samples."""
    chosen = PRESETS.get(preset) if isinstance(preset, str) else preset
    return chosen is not None and chosen.batch is not None


def preset_of(preset: str | Preset | None) -> Preset:
    """Settings by their name; the settings themselves pass through, None is "full"."""
    preset = preset or "full"
    if not isinstance(preset, str):
        return preset
    if preset not in PRESETS:
        raise IdentificationError(
            f"there is no preset '{preset}'; choose one of {', '.join(PRESETS)}"
        )
    return PRESETS[preset]


def fit_adam(problem: Problem, preset: str | Preset | None = None) -> Fit:
    """Descend in x = [λ, ψ] from the first guess with its best friction (Sec. 4.6, 4.7)."""
    settings = preset_of(preset)
    descent = start_of(problem)
    return fit_of(descent, descend(descent, settings))


def fit_levenberg(problem: Problem, cholesky: bool = False) -> Fit:
    """Descend by Levenberg–Marquardt, in λ or in log-Cholesky coordinates of the bodies.

    Where it stops short of an optimum on the boundary of consistency Newton's method goes on.
    """
    descent = start_of(problem, cholesky)
    outcome = levenberg_descend(descent, LevenbergOptions())
    if outcome.status in {Status.MAX_ITERATIONS, Status.STALLED}:
        if not descent.cholesky:
            lib, size = problem.lib, descent.problem.start.size
            safe, _ = _thickened(lib, descent.bodies(outcome.x))
            x = np.concatenate([lib.cholesky_from_pi(safe), outcome.x[size:]])
            descent, outcome = replace(descent, x0=x, cholesky=True), replace(outcome, x=x)
        outcome = newton_descend(descent, outcome)
    return fit_of(descent, outcome)


@one_blas_thread
def fit_many(
    problems: Sequence[Problem],
    preset: Preset,
    threads: int | None = None,
    watch: Watch | None = None,
) -> list[Fit]:
    """`fit_adam` on many problems of one robot at once: multi-start, Monte Carlo."""
    count = threads or cores()
    if not problems:
        return []
    with ThreadPoolExecutor(count) as pool:
        descents = list(pool.map(start_of, problems))
    outcomes = descend_many(descents, preset, count, watch)
    return [fit_of(d, o) for d, o in zip(descents, outcomes, strict=True)]


def start_of(problem: Problem, cholesky: bool = False) -> Descent:
    """Descent from the first guess with its best friction, x = [λ, ψ], (10 n + n k,)."""
    unit = mass_unit(problem.lib, problem.lib.pi_from_lam(problem.start))
    problem = in_unit(problem, unit)
    objective = TorqueObjective(problem.lib, problem.train, problem.weights)
    guess = problem.lib.pi_from_lam(problem.start)
    statistics = problem.statistics()
    phi = best_friction(statistics, guess, problem.train.shape)
    bodies = problem.start
    if cholesky:
        bodies = problem.lib.cholesky_from_pi(problem.lib.nearest_realisable(guess, THINNEST_AXIS))
    held = compress_all(problem.lib, problem.samples("validation"), problem.weights)
    x0 = objective.join(bodies, phi)
    return Descent(problem, objective, statistics, held, x0, cholesky, unit)


def fit_of(descent: Descent, outcome: Outcome) -> Fit:
    """Fit of the outcome of a descent, with π kept off the boundary of consistency."""
    lib, unit = descent.problem.lib, descent.unit
    lam, phi = descent.objective.split(outcome.x)
    left_out = descent.problem.left_out
    if left_out is not None:  # their columns are 0: steps of Newton leave rounding there
        phi = np.where(left_out.reshape(phi.shape), 0.0, phi)
    raw = unit * descent.bodies(outcome.x)
    pi, notes = _thickened(lib, raw)
    trace = outcome.trace
    if unit != 1:  # L in (N·m)² again
        losses = (tuple(unit**2 * np.array(row)) for row in (trace.training, trace.validation))
        trace = Trace(trace.iteration, *losses)
    return Fit(
        pi=pi,
        phi=unit * phi,
        lam=lib.lam_from_pi(pi) if notes or descent.cholesky or unit != 1 else lam,
        status=outcome.status.value,
        iterations=outcome.iterations,
        trace=trace,
        notes=notes,
        unrepaired=float(lib.relative_eigenvalues(raw).min()),
    )


def _thickened(lib: Library, pi: Array) -> tuple[Array, tuple[str, ...]]:
    """π with Σ_com of each link at least `THINNEST_AXIS` of its trace, and a note on the change."""
    safe = lib.nearest_realisable(pi, THINNEST_AXIS)
    thin = lib.relative_eigenvalues(pi) < THINNEST_AXIS
    result = np.where(np.repeat(thin, pi.size // lib.n_links), safe, pi)
    if not thin.any():
        return pi, ()
    names = ", ".join(np.array(lib.link_names)[thin])
    change = float(np.abs(result - pi).max())
    return result, (
        f"the estimate of {names} lies on the boundary of consistency (a plate or a rod); the thin "
        f"axes were kept at the smallest allowed size (largest change {change:.1e} kg·m²)",
    )


ADAM = Method(
    "adam",
    "gradient descent in λ, consistent by construction (document Sec. 4)",
    fit_adam,
    label="λ-Adam",
    from_statistics=True,
    uses_validation=True,
    takes_preset=True,
    in_batches=in_batches,
)
LEVENBERG_MARQUARDT = Method(
    "lm",
    "Levenberg-Marquardt in λ on the compressed data, consistent by construction",
    fit_levenberg,
    from_statistics=True,
    uses_validation=True,
)
LOG_CHOLESKY = replace(
    LEVENBERG_MARQUARDT,
    name="log-cholesky",
    sentence="Levenberg-Marquardt in log-Cholesky coordinates, consistent by construction",
    fit=partial(fit_levenberg, cholesky=True),
    label="log-cholesky",
)
