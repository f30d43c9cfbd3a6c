"""Where the measurements of `bench_identify` enter `runtime`, and their setting.

Each function prepares once and returns a function that measures itself: seconds of one unit.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import runtime
from bench import numpy_identify
from bench.front import BenchError
from runtime.errors import RuntimeFault
from runtime.estimators.classical.pc_ols import follow_compiled
from runtime.estimators.convex.entropic_prior import CAD, prior_of
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.convex.newton import convex_problem, solve
from runtime.estimators.descent.descent import least_squares
from runtime.estimators.descent.fit import Preset, fit_adam, start_of
from runtime.estimators.optimizers import AdamOptions, LevenbergOptions, StoppingRule
from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import Reduced, compress, reduce
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.excitation import COST_SAMPLES, ConditionCost, Trajectory
from runtime.excitation.motion.trajectory import fourier_basis, read_trajectory
from runtime.library import Array, Library
from runtime.library.compiled_descent import CompiledLevenberg
from runtime.library.compiled_programs import CompiledExcitation
from runtime.recording import Preparation, Recording
from runtime.simulation import Plant, ideal
from runtime.simulation.closed_loop import perturbed_lam

TRIALS, PERTURBATION = 150, 0.15  # settings of the document's ideal case (Table 5.2)
BATCH = 64
LEAST = 0.02  # seconds of a measurement
NOISE = 0.05  # standard deviation of the noise of a torque sensor, N·m
RATE = 1000.0  # rate of the training samples, Hz
_EXAMPLE = Path(runtime.__file__).parent / "examples" / "fr3_trajectory.json"
_SMALLER = (1.0, 0.9, 0.8)
"""Training, validation and test are the same trajectory, smaller and smaller."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One robot, one trajectory, noise-free torque."""

    lib: Library
    trajectory: Trajectory
    train: Samples  # at 1 kHz
    weights: Array
    trials: tuple[Recording, ...]  # at 100 Hz, as the document samples them

    def problem(self) -> Problem:
        """All training samples, a few to validate on."""
        few = samples_of(self.trials[1], self.lib)
        start = perturbed_lam(self.lib, PERTURBATION, np.random.default_rng(0))
        return Problem(self.lib, self.train, few, self.weights, start)


Door = Callable[[Setting], Callable[[], float]]


def setting(lib: Library) -> Setting:
    """The example trajectory of the FR3."""
    try:
        trajectory = read_trajectory(_EXAMPLE, lib)
    except RuntimeFault as error:
        raise BenchError(f"this benchmark is about the FR3: {error}") from None
    plant = Plant(lib.pi0)
    train = samples_of(ideal(lib, trajectory, plant, RATE), lib)
    smaller = (
        Trajectory(trajectory.home, scale * trajectory.coefficients, trajectory.duration)
        for scale in _SMALLER
    )
    trials = tuple(ideal(lib, item, plant) for item in smaller)
    return Setting(lib, trajectory, train, thesis_weights(train.tau), trials)


def repeated(work: Callable[[], object], units: int = 1) -> Callable[[], float]:
    """Seconds of one of `units` in `work`, called as often as fills `LEAST` seconds."""
    work()  # warms up
    start = time.perf_counter()
    work()
    calls = max(1, round(LEAST / (time.perf_counter() - start)))

    def once() -> float:
        begin = time.perf_counter()
        for _ in range(calls):
            work()
        return (time.perf_counter() - begin) / (calls * units)

    return once


def _slope(run: Callable[[int], object], short: int, long: int) -> Callable[[], float]:
    """Seconds of one iteration: a long run less a short one, what is done once drops out."""

    def once() -> float:
        took = []
        for count in (short, long):
            start = time.perf_counter()
            run(count)
            took.append(time.perf_counter() - start)
        return max(took[1] - took[0], 1e-12) / (long - short)

    return once


# --- ours -----------------------------------------------------------------------------------


def statistics(s: Setting) -> Callable[[], float]:
    """`statistics.compress`, per sample, of torque with the noise of a sensor.

    Exact torque leaves no residual, so that its rows are eliminated: `statistics_of_exact`.
    """
    noisy = _noisy(s)
    return repeated(lambda: compress(s.lib, noisy, s.weights), len(noisy))


def statistics_of_exact(s: Setting) -> Callable[[], float]:
    """`statistics.compress`, per sample, of rows that are eliminated."""
    return repeated(lambda: compress(s.lib, s.train, s.weights), len(s.train))


def adam_full(s: Setting) -> Callable[[], float]:
    """`identification.fit_adam` on all samples, per iteration."""
    return _adam(s, None, 1_000, 41_000)


def adam_batch(s: Setting) -> Callable[[], float]:
    """`identification.fit_adam` on mini-batches, per iteration."""
    return _adam(s, BATCH, 1_000, 11_000)


def _adam(s: Setting, batch: int | None, short: int, long: int) -> Callable[[], float]:
    problem = s.problem()
    problem.statistics()  # kept by the problem

    def run(count: int) -> None:
        rule = StoppingRule(count, count + 1)
        fit = fit_adam(problem, Preset(AdamOptions(1e-6), rule, batch))
        if fit.iterations != count:
            raise BenchError(f"the descent ended after {fit.iterations} of {count} iterations")

    return _slope(run, short, long)


def levenberg(s: Setting) -> Callable[[], float]:
    """`Library.levenberg`, per step."""
    fresh = _levenberg(s, cholesky=False)

    def once() -> float:
        jobs = fresh()
        start = time.perf_counter()
        jobs.run(5)
        return (time.perf_counter() - start) / jobs[0].step

    return once


def _levenberg(s: Setting, cholesky: bool) -> Callable[[], CompiledLevenberg]:
    """What makes a descent from the first guess."""
    descent, options = start_of(s.problem(), cholesky), LevenbergOptions()
    squares = least_squares(descent.statistics, descent.objective.unit)
    names = ("first_damping", "step_tolerance", "decrease_tolerance")
    settings = {name: getattr(options, name) for name in names}
    most, binding = options.max_iterations, s.lib.binding
    return lambda: CompiledLevenberg(binding, [descent.x0], [squares], settings, most, cholesky)


def excitation_value(s: Setting) -> Callable[[], float]:
    """`CompiledExcitation` without its gradient."""
    t = s.trajectory
    times = np.linspace(0.0, t.duration, COST_SAMPLES)[: COST_SAMPLES // 2]
    basis = fourier_basis(s.lib, t.coefficients.shape[1], times, t.duration)[..., :3]
    cost = CompiledExcitation.of(s.lib.binding, t.home, basis)
    return repeated(lambda: cost.value(t.coefficients))


def excitation_gradient(s: Setting) -> Callable[[], float]:
    """`ConditionCost.value_gradient`."""
    t = s.trajectory
    cost = ConditionCost(s.lib, t.home, t.coefficients.shape[1], t.duration)
    return repeated(lambda: cost.value_gradient(t.coefficients))


def monte_carlo(s: Setting) -> Callable[[], float]:
    """`identify` from perturbed starts with the document's settings, all trials."""
    train, validation, test = s.trials
    bare = {"preparation": Preparation(), "friction": (), "refit": False, "certify": False}

    def once() -> float:
        rng = np.random.default_rng(0)
        start = time.perf_counter()
        for k in range(TRIALS):
            runtime.identify(
                train,
                s.lib,
                preset="simulation",
                validation=validation,
                test=test,
                lam0=perturbed_lam(s.lib, PERTURBATION, rng),
                seed=k,
                **bare,
            )
        return time.perf_counter() - start

    return once


# --- NumPy ----------------------------------------------------------------------------------


def numpy_statistics(s: Setting) -> Callable[[], float]:
    """Σ Y_bᵀ W Y_b with a stored Y_b, its evaluation included."""
    return repeated(lambda: numpy_identify.gram(s.lib, s.train, s.weights), len(s.train))


def _numpy_steps(method: Callable[..., Callable[[int], object]], count: int, *more: int) -> Door:
    """Steps of a descent, `count` at a time."""

    def prepared(s: Setting) -> Callable[[], float]:
        run = method(s.lib, s.problem().start, s.train, s.weights, *more)
        return repeated(lambda: run(count), count)

    return prepared


def _numpy_cost(which: int) -> Door:
    """Gram matrix and its eigenvalues, or their forward differences in every coefficient."""

    def prepared(s: Setting) -> Callable[[], float]:
        t = s.trajectory
        shape = (s.lib, t.home, t.coefficients.shape[1], t.duration)
        work = numpy_identify.log_condition(*shape)[which]
        return repeated(lambda: work(t.coefficients))

    return prepared


numpy_adam_full = _numpy_steps(numpy_identify.adam_full, 500)
numpy_adam_batch = _numpy_steps(numpy_identify.adam_batch, 200, BATCH)
numpy_levenberg = _numpy_steps(numpy_identify.levenberg, 20)
numpy_excitation_value, numpy_excitation_gradient = _numpy_cost(0), _numpy_cost(1)

FALL = 1e-6  # loss at which a descent counts as converged: a thousandth of the initial torque error
SAMPLES = 20_000  # number of samples of a whole identification


def most_probable(s: Setting) -> Callable[[], float]:
    """`convex.solve` on compressed data."""
    problem = convex_problem(*_convex(s))
    return repeated(lambda: solve(s.lib, problem))


def path(s: Setting) -> Callable[[], float]:
    """`convex.newton.follow_compiled`: PC-IDIM-OLS on compressed data."""
    data, prior, _ = _convex(s)
    return repeated(lambda: follow_compiled(s.lib, data, prior))


def log_cholesky(s: Setting) -> Callable[[], float]:
    """`Library.levenberg` in log-Cholesky coordinates on compressed noise-free data.

    Until the loss is `FALL` of its first value; the last digits are those of links without width.
    """
    fresh = _levenberg(s, cholesky=True)
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
    noisy = _noisy(s)
    arrays = (noisy.q, noisy.dq, noisy.ddq, noisy.tau, noisy.columns)
    long = Samples(*(np.resize(each, (SAMPLES, *each.shape[1:])) for each in arrays))
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
