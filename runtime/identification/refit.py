"""Second fit of a result, to all rows of its recording.

The method, the friction model and the weights are chosen, and the errors computed, with the fit to
the training part. What is chosen is then fitted to the rows of all parts: the parameters of a robot
come from all that was recorded. Its covariance is smaller by the number of rows, and what `predict`
expects of a log is what `identify` reaches.
"""

from dataclasses import replace
from itertools import chain

import numpy as np

from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.problem_setup import Assembly
from runtime.identification.settings import Settings
from runtime.library import Array


def is_refitted(assembly: Assembly, settings: Settings, method: str) -> bool:
    """Whether a result is fitted to all rows after its errors are known."""
    rows_of_joints = assembly.problem.train.equations == assembly.problem.lib.n_joints
    train, _, test = assembly.parts
    return (
        settings.refit
        and assembly.one_run
        and not np.array_equal(train.t, test.t)  # else all rows train already
        and rows_of_joints
        and not METHODS[method].needs_samples(settings.preset)
    )


def with_all_rows(assembly: Assembly) -> Assembly:
    """The same problem with the rows of all parts for training."""
    problem = assembly.problem
    test = samples_of(assembly.parts[2], problem.lib)
    rest = (test,) if assembly.is_joined else (problem.validation, test)
    rows = joined((problem.train, *rest))
    whole = replace(problem, train=rows, terms=assembly.friction)
    pieces = problem.pieces
    if pieces is not None:  # a streamed log: `rows` are those of its windows
        names = ("train", "test") if assembly.is_joined else ("train", "validation", "test")
        whole = replace(whole, pieces=lambda _: chain.from_iterable(map(pieces, names)))
    return replace(assembly, problem=whole)


def rows_of(problem: Problem, fit: Fit) -> int:
    """Number of samples of a fit, those of a streamed log outside of its windows included."""
    if problem.pieces is None:
        return len(problem.train)
    return round((fit.statistics or problem.statistics()).n_samples)


def joined(parts: tuple[Samples, ...]) -> Samples:
    """Samples of several parts, one after the other."""
    first = parts[0]

    def column(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    return Samples(
        column("q"),
        column("dq"),
        None if first.acceleration is None else column("acceleration"),
        column("tau"),
        column("columns"),
        coupling=first.coupling,
        base=None if first.base is None else column("base"),
    )
