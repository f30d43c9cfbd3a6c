"""The minimisers of `newton` and `path` in compiled C, many at once over threads.

For problems with linear priors `newton.minimise_anywhere` is used.
"""

from collections.abc import Sequence

import numpy as np

from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.newton import (
    DECREMENT,
    MOST_STEPS,
    ConvexProblem,
    Minimum,
    better,
    factors,
    minimise_anywhere,
)
from runtime.estimators.convex.path import PATIENCE, SHRINK, Path, gamma_sequence, path_of
from runtime.library import Array, ConvexAnswer, ConvexTask, Library
from runtime.library.parameters import N_PARAMETERS


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
    tasks = [_task(p, np.ones(1), s) for p, s in zip(problems, firsts, strict=True)]
    answers = lib.convex(tasks, DECREMENT, MOST_STEPS).run(threads)
    minima = [_minimum(p, answer) for p, answer in zip(problems, answers, strict=True)]
    return _continued(lib, minima, firsts, threads)


def follow_compiled(
    lib: Library,
    data: Reduced,
    prior: Prior,
    shrink: float = SHRINK,
    most_steps: int = PATIENCE,
) -> Path:
    """Follow a path by the compiled Newton method."""
    return follow_many(lib, [data], [prior], 1, shrink, most_steps)[0]


def follow_many(
    lib: Library,
    data: Sequence[Reduced],
    priors: Sequence[Prior],
    threads: int = 1,
    shrink: float = SHRINK,
    most_steps: int = PATIENCE,
) -> list[Path]:
    """Follow the paths of many problems of one robot."""
    pairs = list(zip(data, priors, strict=True))
    sequences = [gamma_sequence(d, p.centre.size // N_PARAMETERS, shrink) for d, p in pairs]
    tasks = [
        _task(ConvexProblem(d, p, np.ones(p.centre.size // N_PARAMETERS)), gammas)
        for (d, p), gammas in zip(pairs, sequences, strict=True)
    ]
    answers = lib.convex(tasks, DECREMENT, most_steps).run(threads)
    paths = []
    for (_, prior), gammas, a in zip(pairs, sequences, answers, strict=True):
        ended, steps = float(a.decrements[-1]), int(a.steps.sum())
        tried = gammas[: len(a.losses)]
        paths.append(path_of(prior, tried, a.points, a.losses, ended, steps, a.converged))
    return paths


def _continued(
    lib: Library, minima: list[Minimum], starts: list[Array | None], threads: int
) -> list[Minimum]:
    """The minima, those without convergence by continuation in γ."""
    tasks, places = [], []
    for k, (minimum, start) in enumerate(zip(minima, starts, strict=True)):
        problem = minimum.problem
        if minimum.converged or not _is_inside(problem, start):
            continue
        tasks.append(_task(problem, factors(problem, problem.prior.centre)))
        places.append(k)
    if not tasks:
        return minima
    results = list(minima)
    for k, answer in zip(
        places, lib.convex(tasks, DECREMENT, MOST_STEPS).run(threads), strict=True
    ):
        results[k] = better(minima[k], _minimum(minima[k].problem, answer))
    return results


def _is_inside(problem: ConvexProblem, start: Array | None) -> bool:
    """Whether every body of the first point is strictly consistent."""
    return start is None or problem.prior.bodies.log_det(start) is not None


def _task(problem: ConvexProblem, gammas: Array, start: Array | None = None) -> ConvexTask:
    data, prior = problem.data, problem.prior
    return ConvexTask(
        data.factor,
        data.target,
        data.rest,
        data.count,
        prior.slope,
        problem.gamma,
        gammas,
        prior.centre if start is None else start,
    )


def _minimum(problem: ConvexProblem, answer: ConvexAnswer) -> Minimum:
    return Minimum(
        problem,
        answer.points[-1],
        float(answer.losses[-1]),
        float(answer.decrements[-1]),
        int(answer.steps.sum()),
        answer.converged,
    )
