"""Where the estimators' measurements of `bench_identify` enter `runtime`.

Each function prepares once and returns a function that measures itself: seconds of one unit.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.doors import Setting, repeated
from runtime.estimators.convex import CAD, Reduced, convex_problem, prior_of, reduce, solve
from runtime.estimators.convex.compiled import follow_compiled
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.descent.descent import least_squares
from runtime.estimators.descent.fit import start_of
from runtime.estimators.optimizers import LevenbergOptions
from runtime.estimators.problem import Problem
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import Samples
from runtime.library.compiled_descent import CompiledLevenberg

NOISE = 0.05
"""Standard deviation of the torque noise, N·m."""
FALL = 1e-6
"""Loss at which a descent counts as converged: a thousandth of the initial torque error."""
SAMPLES = 20_000
"""Number of samples of a whole identification."""


def most_probable(s: Setting) -> Callable[[], float]:
    """`convex.solve` on compressed data."""
    problem = convex_problem(*_convex(s))
    return repeated(lambda: solve(s.lib, problem))


def path(s: Setting) -> Callable[[], float]:
    """`convex.compiled.follow_compiled`: PC-IDIM-OLS on compressed data."""
    data, prior, _ = _convex(s)
    return repeated(lambda: follow_compiled(s.lib, data, prior))


def log_cholesky(s: Setting) -> Callable[[], float]:
    """`Library.levenberg` in log-Cholesky coordinates on compressed noise-free data.

    Until the loss is `FALL` of its first value; the last digits are those of links without width.
    """
    descent, options = start_of(s.problem(), cholesky=True), LevenbergOptions()
    squares = least_squares(descent.statistics, descent.objective.unit)
    names = ("first_damping", "step_tolerance", "decrease_tolerance")
    settings = {name: getattr(options, name) for name in names}

    def fresh() -> CompiledLevenberg:
        return s.lib.levenberg(
            [descent.x0], [squares], settings, options.max_iterations, cholesky=True
        )

    jobs, steps = fresh(), 0
    jobs.run(0)
    first = jobs[0].loss
    while jobs[0].loss > FALL * first:
        jobs.run(1)
        steps += 1

    def once() -> float:
        again = fresh()
        start = time.perf_counter()
        again.run(steps)
        return time.perf_counter() - start

    return once


def identified(s: Setting) -> Callable[[], float]:
    """`posterior.fit_map` from samples: weights, compression, correlation, solution."""
    train = _noisy(s)
    times = -(-SAMPLES // len(train))
    long = Samples(*(np.concatenate([a] * times)[:SAMPLES] for a in _arrays(train)))
    start = s.problem()

    def once() -> float:
        problem = Problem(
            s.lib, long, start.validation, start.weights, s.lib.lam0
        )  # a fresh one: problems keep their statistics
        begin = time.perf_counter()
        fit_map(problem)
        return time.perf_counter() - begin

    return once


def _convex(s: Setting) -> tuple[Reduced, object, float]:
    statistics = compress(s.lib, _noisy(s), np.full(s.lib.n_joints, 1 / NOISE**2))
    data, _ = reduce(statistics, s.lib.n_joints)
    return data, prior_of(s.lib), CAD * data.variance / data.count


def _noisy(s: Setting) -> Samples:
    rng = np.random.default_rng(0)
    return replace(s.train, tau=s.train.tau + NOISE * rng.normal(size=s.train.tau.shape))


def _arrays(samples: Samples) -> tuple[np.ndarray, ...]:
    return samples.q, samples.dq, samples.ddq, samples.tau, samples.columns
