"""Monte Carlo of the document (Sec. 5.1): exact motion, perturbed initial guess, many trials.

λ₀ = λ_true + p λ_true ⊙ ε (Eq. 5.2), τ_noisy = τ + σ ε (Eq. 5.8), one weighting of Eq. 4.8 per
trial. Every trial has independent random streams (guess, noise, mini-batches), which are
the same in all cases and for all methods.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from runtime.estimators.classical.pc_ols import fit_pc_ols
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.descent.adam import Preset, Watch
from runtime.estimators.descent.fit import PRESETS, fit_levenberg
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.experiments.study import Arrays, Row
from runtime.experiments.trials.motions import designed, document_robot
from runtime.experiments.trials.scores import Scorer, scorer_of
from runtime.experiments.trials.timed_fits import adam_of_all, fit_frozen, stream, timed
from runtime.library import Array, Library
from runtime.simulation import Plant, ideal

GUESS, NOISE, HELD_NOISE, BATCHES = range(4)
"""Random streams of a trial."""
METHODS = {
    "adam": "λ-Adam on mini-batches with the settings of Table 5.1; improvements of the validation "
    "loss count from 2e-6 on, which the document does not state; thin axes are raised at the end",
    "adam-zero": "the same, where every improvement of the validation loss counts",
    "map": "most probable consistent model, initial guess of the trial as prior (κ = 16)",
    "lm": "MAP, then Levenberg–Marquardt in log-Cholesky coordinates to the optimum of the data",
    "pc-ols": "PC-IDIM-OLS, same weights: optimum of the convex problem nearest to the guess",
    "adam-frozen": "λ-Adam with link 7 neither perturbed nor updated, and w₇ = 0",
}


@dataclass(frozen=True, slots=True)
class Case:
    """One column of a table."""

    name: str  # name in all files
    perturbation: float  # relative perturbation p of the initial guess
    noise: float = 0.0  # σ of the torque [N·m]
    training: str = "designed"  # name of the training motion
    methods: tuple[str, ...] = ("adam", "adam-zero", "lm")  # names of `METHODS`


@dataclass(frozen=True, slots=True)
class MonteCarloConfig:
    """Config of a Monte Carlo study."""

    cases: tuple[Case, ...]
    seed: int = 0  # of all trials
    rate_hz: float = 100.0  # of the samples
    # Table 5.1; its stopping threshold (2e-6) is not in the document
    adam: Preset = PRESETS["simulation"]
    configurations: int = 50  # number of configurations at which mass matrices are compared
    curve_every: int = 25  # iterations between two points of an AIRM curve
    # amplitude of Eq. 5.5 as a share of the limits, and the seed of its phases
    sinusoid: tuple[float, int] = (0.5, 0)


@dataclass(frozen=True, slots=True)
class MonteCarloSetup:
    """Input that all trials share."""

    lib: Library
    config: MonteCarloConfig
    lam: Array  # (10 n,) λ of the true robot
    train: dict[str, Samples]  # samples without noise by name of the motion
    held: Samples  # validation samples without noise
    scorer: Scorer


def setup_of(lib: Library, config: MonteCarloConfig, needed: Arrays) -> MonteCarloSetup:
    """Samples of the designed motions, best first: training, validation, test."""
    pi = document_robot(lib)
    runs = [
        samples_of(ideal(lib, motion, Plant(pi), config.rate_hz), lib)
        for motion in designed(lib, needed)
    ]
    return MonteCarloSetup(
        lib=lib,
        config=config,
        lam=lib.lam_from_pi(pi),
        train={"designed": runs[0]},
        held=runs[1],
        scorer=scorer_of(lib, runs[2], pi, config.configurations),
    )


def run_cases(setup: MonteCarloSetup, numbers: range, threads: int) -> list[Row]:
    """Fit all cases and methods of some trials; Adam runs all trials of a case in one C call."""
    solvers = {"map": fit_map, "lm": fit_from_map, "pc-ols": fit_pc_ols}
    rows: list[Row] = []
    for case in setup.config.cases:
        problems = [problem_of(setup, case, number) for number in numbers]
        for method in case.methods:
            if method in {"adam", "adam-zero"}:
                fits = _adam(setup, problems, threads, _preset(setup.config.adam, method))
            elif method == "adam-frozen":
                fits = [_frozen(setup, problem) for problem in problems]
            else:
                fits = [(*timed(solvers[method], problem), []) for problem in problems]
            for number, problem, (fit, seconds, curve) in zip(numbers, problems, fits, strict=True):
                rows.append(_row(setup, case, method, number, problem, fit))
                rows[-1] |= {"time_s": seconds} | ({"curve": curve} if curve else {})
    return rows


def problem_of(setup: MonteCarloSetup, case: Case, number: int) -> Problem:
    """Identification problem of one trial of one case."""
    config, lib = setup.config, setup.lib
    train, held = setup.train[case.training], setup.held
    if case.noise:
        train = _noisy(train, case.noise, config.seed, number, NOISE)
        held = _noisy(held, case.noise, config.seed, number, HELD_NOISE)
    guess = stream(config.seed, number, GUESS).normal(size=setup.lam.size)
    batches = int(stream(config.seed, number, BATCHES).integers(2**63))
    start = setup.lam * (1 + case.perturbation * guess)
    return Problem(lib, train, held, thesis_weights(train.tau), start, seed=batches)


def _noisy(samples: Samples, sigma: float, seed: int, number: int, which: int) -> Samples:
    noise = stream(seed, number, which).normal(size=samples.tau.shape)
    return replace(samples, tau=samples.tau + sigma * noise)


TimedFit = tuple[Fit, float, list[float]]
"""A fit, its time [s], and its AIRM over the iterations."""


def _preset(preset: Preset, method: str) -> Preset:
    """Settings of one of both variants of λ-Adam."""
    if method == "adam":
        return preset
    return replace(preset, rule=replace(preset.rule, threshold=0.0))


def _adam(
    setup: MonteCarloSetup, problems: Sequence[Problem], threads: int, preset: Preset
) -> list[TimedFit]:
    config, lib = setup.config, setup.lib
    places: list[list[Array]] = [[] for _ in problems]

    def seen(done: int, points: list[Array]) -> None:
        del done
        for place, x in zip(places, points, strict=True):
            place.append(x)

    fits = adam_of_all(problems, preset, threads, Watch(config.curve_every, seen))
    ended = []
    for problem, (fit, seconds), place in zip(problems, fits, places, strict=True):
        points = [problem.start, *place[: (fit.iterations or 0) // config.curve_every]]
        curve = [setup.scorer.airm(lib.pi_from_lam(x)) for x in points]
        ended.append((fit, seconds, curve))
    return ended


def _frozen(setup: MonteCarloSetup, problem: Problem) -> TimedFit:
    places: list[Array] = []
    fit, seconds = timed(
        lambda each: fit_frozen(each, setup.lam, setup.config.adam, places), problem
    )
    seen = places[:: setup.config.curve_every]
    return fit, seconds, [setup.scorer.airm(setup.lib.pi_from_lam(x)) for x in seen]


def fit_from_map(problem: Problem) -> Fit:
    """MAP, then Levenberg–Marquardt without the prior, because the data have no noise."""
    near = problem.lib.lam_from_pi(fit_map(problem).pi)
    return fit_levenberg(replace(problem, start=near), cholesky=True)


def _row(
    setup: MonteCarloSetup, case: Case, method: str, number: int, problem: Problem, fit: Fit
) -> Row:
    row: Row = {"case": case.name, "method": method, "trial": number, "status": fit.status}
    row |= setup.scorer.row(fit.pi, unrepaired=fit.unrepaired)
    row |= {"iterations": fit.iterations, "loss": problem.statistics().value(fit.pi, fit.phi)}
    # Without noise the residuals are rounding errors, which have no effective sample size.
    return row | ({} if fit.n_eff is None or not case.noise else {"n_eff": fit.n_eff})
