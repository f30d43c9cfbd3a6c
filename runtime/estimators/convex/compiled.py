"""The same minimisers by the library's C, many at once over threads; NumPy where there is none.

Further linear priors are rare and small, and stay with `newton.minimise`.
"""

from collections.abc import Sequence

import numpy as np

from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.newton import DECREMENT, MOST_STEPS, ConvexProblem, Minimum, minimise
from runtime.estimators.convex.path import PATIENCE, SHRINK, Path, follow, gamma_sequence, path_of
from runtime.library import Array, ConvexAnswer, ConvexTask, Library
from runtime.library.parameters import N_PARAMETERS


def solve(lib: Library, problem: ConvexProblem, start: Array | None = None) -> Minimum:
    """`newton.minimise` by the compiled loop where there is one."""
    return solve_many(lib, [problem], [start])[0]


def solve_many(
    lib: Library,
    problems: Sequence[ConvexProblem],
    starts: Sequence[Array | None] | None = None,
    threads: int = 1,
) -> list[Minimum]:
    """Minimise many problems of one robot: Monte Carlo. The answers do not depend on `threads`."""
    firsts = list(starts) if starts is not None else [None] * len(problems)
    plain = all(p.inside is None and p.free is None for p in problems)
    if not lib.solves_convex or not plain or not problems:
        return [minimise(p, s) for p, s in zip(problems, firsts, strict=True)]
    tasks = [_task(p, np.ones(1), s) for p, s in zip(problems, firsts, strict=True)]
    answers = lib.convex(tasks, DECREMENT, MOST_STEPS).run(threads)
    return [_minimum(p, answer) for p, answer in zip(problems, answers, strict=True)]


def follow_compiled(
    lib: Library,
    data: Reduced,
    prior: Prior,
    shrink: float = SHRINK,
    most_steps: int = PATIENCE,
) -> Path:
    """`path.follow` by the compiled loop where there is one."""
    return follow_many(lib, [data], [prior], 1, shrink, most_steps)[0]


def follow_many(
    lib: Library,
    data: Sequence[Reduced],
    priors: Sequence[Prior],
    threads: int = 1,
    shrink: float = SHRINK,
    most_steps: int = PATIENCE,
) -> list[Path]:
    """The paths of many problems of one robot."""
    pairs = list(zip(data, priors, strict=True))
    ladders = [gamma_sequence(d, p.centre.size // N_PARAMETERS, shrink) for d, p in pairs]
    if not lib.solves_convex or not pairs:
        return [follow(d, p, g, most_steps) for (d, p), g in zip(pairs, ladders, strict=True)]
    tasks = [
        _task(ConvexProblem(d, p, np.ones(p.centre.size // N_PARAMETERS)), ladder)
        for (d, p), ladder in zip(pairs, ladders, strict=True)
    ]
    answers = lib.convex(tasks, DECREMENT, most_steps).run(threads)
    found = []
    for (_, prior), ladder, a in zip(pairs, ladders, answers, strict=True):
        ended, steps = float(a.decrements[-1]), int(a.steps.sum())
        tried = ladder[: len(a.losses)]
        found.append(path_of(prior, tried, a.points, a.losses, ended, steps, a.converged))
    return found


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
        answer.points[0],
        float(answer.losses[0]),
        float(answer.decrements[0]),
        int(answer.steps[0]),
        answer.converged,
    )
