"""Monte Carlo of the document (Sec. 5.1): exact motion, perturbed initial guess, many trials.

λ₀ = λ_true + p λ_true ⊙ ε (Eq. 5.2), τ_noisy = τ + σ ε (Eq. 5.8), one weighting of Eq. 4.8 per
trial. Every trial has independent random streams (guess, noise, mini-batches), which are
the same in all cases and for all methods. Motions are designs of the excitation study and sines;
an interrupted descent raises KeyboardInterrupt.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.descent.fit import PRESETS, Preset, Watch, fit_many, fit_of, start_of
from runtime.estimators.methods import METHODS as ESTIMATORS
from runtime.estimators.optimizers import Status, adam
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.factor import TorqueObjective
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.excitation import Trajectory, log_condition
from runtime.experiments.study import MOTION, Arrays, Row
from runtime.identification.metrics import CONSISTENCY_TOLERANCE, airm, frobenius, torque_error
from runtime.library import Array, Library, Mask
from runtime.library.parameters import links, mass
from runtime.recording import Recording
from runtime.simulation import Plant, ideal, sample_times

ROBOT = "fr3"

LINK_7 = (  # π of link 7 [kg, kg·m, kg·m²]
    *(1.2542865724, 5.6726134989e-3, 1.0819716922e-2, -2.0273441638e-2, 9.4286696773e-4),
    *(8.0771244614e-4, 3.3885162663e-4, -9.7599036040e-5, 1.8297790402e-4, 3.4976400656e-4),
)


def document_robot(lib: Library) -> Array:
    """Parameters π (70,) of the true robot [kg, kg·m, kg·m²]."""
    if lib.name != ROBOT:
        raise IdentificationError(
            f"expected the robot '{ROBOT}' of the document, got '{lib.name}'; "
            f"run: python -m symgen build {ROBOT}"
        )
    return np.concatenate([lib.pi0[: -len(LINK_7)], LINK_7])


PULSATION = 2.0  # angular frequency of Eq. 5.5 [rad/s]
ROLES = ("training", "validation", "test")  # roles of the three best designs, best first


def designed(lib: Library, needed: Arrays) -> list[Trajectory]:
    """Best designs in the order of `ROLES`."""
    duration = float(needed["duration"])
    return [Trajectory(lib.home, np.array(a), duration) for a in needed["coefficients"]]


def sinusoidal(
    lib: Library, duration: float, rate_hz: float, share: float, seed: int
) -> tuple[Recording, Array]:
    """Motion q = a + b sin(2t + φ) (Eqs. 5.5–5.7) and its amplitudes b, (n,) [rad].

    The document states neither a nor b: here a is the default pose and b a share of the largest
    amplitude within the limits of position, velocity and acceleration. φ ~ U(0, 2π) per joint.
    """
    limits = lib.limits()
    room = np.minimum(limits["upper"] - lib.home, lib.home - limits["lower"])
    fast = np.minimum(limits["velocity"] / PULSATION, limits["acceleration"] / PULSATION**2)
    b = share * np.minimum(room, fast)
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, lib.n_joints)
    t = sample_times(duration, rate_hz)
    angle = PULSATION * t[:, None] + phase
    turn, rate = b * np.sin(angle), PULSATION * b * np.cos(angle)
    q, dq, ddq = lib.home + turn, rate, -(PULSATION**2) * turn
    sentence = f"Sines of {PULSATION:g} rad/s, {len(t)} samples at {rate_hz:g} Hz."
    recording = Recording(
        t, q, dq, ddq, name="sinusoidal", joint_names=lib.joint_names, history=(sentence,)
    )
    return recording, b


def condition(lib: Library, samples: Samples) -> float:
    """Condition number of the column-normalised base regressor of all samples."""
    rows = lib.base_regressor(samples.q, samples.dq, samples.ddq)
    return float(np.exp(log_condition(rows.reshape(-1, rows.shape[-1]))[0]))


def curves(prefix: str, recording: Recording) -> dict[str, Array]:
    """Series t, q, dq, ddq and tau of a recording."""
    named = {key: getattr(recording, key) for key in MOTION}
    return {f"{prefix}_{key}": value for key, value in named.items() if value is not None}


@dataclass(frozen=True, slots=True)
class Scorer:
    """Reference to which results are compared."""

    lib: Library  # the robot
    test: Samples  # motion and torque that no method has used; without noise in simulation
    pi: Array | None  # (10 n,) true parameters; None where unknown
    configurations: Array  # (K, n) positions at which mass matrices are compared [rad, m]
    mass: Array  # (K, n, n) true mass matrices

    def row(self, pi: Array, friction: Array | None = None, unrepaired: float | None = None) -> Row:
        """Metrics of a result: airm, frobenius, torque errors, base error, consistency."""
        lib, test = self.lib, self.test
        predicted = lib.inverse_dynamics(test.q, test.dq, test.ddq, pi)
        if friction is not None:
            predicted = predicted + friction
        error = torque_error(test.tau, predicted)
        smallest = float(lib.relative_eigenvalues(pi).min())
        possible = smallest >= -CONSISTENCY_TOLERANCE and (mass(links(pi)) > 0).all()
        row: Row = {}
        if self.pi is not None:
            distance = float(frobenius(self.mass, lib.mass_matrix(self.configurations, pi)).mean())
            beta, truth = lib.base_matrix @ pi, lib.base_matrix @ self.pi
            if possible:  # else the mass matrix may be indefinite, for which the AIRM is undefined
                row["airm"] = self.airm(pi)
            row |= {
                "frobenius": distance,
                "frobenius_rms": distance / lib.n_joints,
                "base_error": 100 * float(np.linalg.norm(beta - truth) / np.linalg.norm(truth)),
            }
        before = smallest if unrepaired is None else unrepaired
        row |= {"consistent": bool(possible), "smallest_eigenvalue": before}
        row["strict"] = bool(before > CONSISTENCY_TOLERANCE)
        row |= per_joint("tau_error", error.percent) | per_joint("tau_rms", error.rms)
        return row | {"tau_error": error.overall}

    def airm(self, pi: Array) -> float:
        """Mean affine-invariant distance of the mass matrices for π (10 n,)."""
        return float(airm(self.mass, self.lib.mass_matrix(self.configurations, pi)).mean())


def scorer_of(lib: Library, test: Samples, pi: Array | None, configurations: int) -> Scorer:
    """Scorer at equally spaced configurations of the test trajectory."""
    rows = np.linspace(0, len(test) - 1, configurations).round().astype(int)
    q = np.ascontiguousarray(test.q[rows])
    mass = np.zeros((0, lib.n_joints, lib.n_joints)) if pi is None else lib.mass_matrix(q, pi)
    return Scorer(lib, test, pi, q, mass)


def per_joint(name: str, values: Array) -> Row:
    """Metrics `NAME_1` … `NAME_n`."""
    return {f"{name}_{joint}": float(x) for joint, x in enumerate(values, start=1)}


def torque_rms(tau: Array) -> Array:
    """RMS √(Σ τ²/N) per joint (n,) of torques (N, n) [N·m, N]."""
    return np.asarray(np.sqrt(np.mean(tau**2, axis=0)))


LINK = 6  # index of link 7, from 0


def link_rows(lib: Library) -> Mask:
    """Mask (10 n,) of the entries of λ that belong to link 7."""
    return np.arange(lib.lam0.size) // (lib.lam0.size // lib.n_links) == LINK


def fit_frozen(problem: Problem, truth: Array, preset: Preset, places: list[Array]) -> Fit:
    """Fit by the descent in NumPy, because the compiled one updates every link."""
    lib, batch = problem.lib, preset.batch or len(problem.train)
    frozen = link_rows(lib)
    weights = np.where(np.arange(lib.n_joints) == LINK, 0.0, problem.weights)
    start = np.where(frozen, truth, problem.start)
    descent = start_of(replace(problem, weights=weights, start=start))
    # Friction coefficients follow λ in x and are never frozen.
    fixed = np.concatenate([frozen, np.zeros(descent.x0.size - frozen.size, dtype=bool)])
    objective, size = descent.objective, len(problem.train)
    held = TorqueObjective(lib, problem.validation, weights, objective.unit)
    rng = np.random.default_rng(problem.seed)

    def value_gradient(x: Array) -> tuple[float, Array]:
        places.append(x)
        loss, slope = objective.value_gradient(x, rng.integers(0, size, batch))
        return loss, np.where(fixed, 0.0, slope)

    return fit_of(descent, adam(value_gradient, preset.adam, descent.x0, held.value, preset.rule))


def stream(seed: int, number: int, which: int) -> np.random.Generator:
    """Random generator of one trial, independent of all other trials and streams."""
    return np.random.default_rng((seed, number, which))


def adam_of_all(
    problems: Sequence[Problem], preset: Preset, threads: int, watch: Watch | None = None
) -> list[tuple[Fit, float]]:
    """Fit λ-Adam to all problems in one C call; its time is divided by iterations."""
    start = time.perf_counter()
    fits = fit_many(problems, preset, threads, watch=watch)
    seconds = time.perf_counter() - start
    _require_uninterrupted(fits)
    each = seconds / max(sum(fit.iterations or 0 for fit in fits), 1)
    return [(fit, each * (fit.iterations or 0)) for fit in fits]


def timed(method: Callable[[Problem], Fit], problem: Problem) -> tuple[Fit, float]:
    """Fit one method to one problem."""
    start = time.perf_counter()
    fit = method(problem)
    seconds = time.perf_counter() - start
    _require_uninterrupted([fit])
    return fit, seconds


def _require_uninterrupted(fits: Sequence[Fit]) -> None:
    if any(fit.status == Status.INTERRUPTED.value for fit in fits):
        raise KeyboardInterrupt


GUESS, NOISE, HELD_NOISE, BATCHES = range(4)  # random streams of a trial
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
    adam: Preset = PRESETS["simulation"]  # Table 5.1; its threshold (2e-6) is not in the document
    configurations: int = 50  # number of configurations at which mass matrices are compared
    curve_every: int = 25  # iterations between two points of an AIRM curve
    sinusoid: tuple[float, int] = (0.5, 0)  # Eq. 5.5: share of the limits, and seed of phases


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
    """Samples of the motions of the excitation study."""
    return setup_along(lib, config, designed(lib, needed))


def setup_along(
    lib: Library, config: MonteCarloConfig, motions: Sequence[Trajectory]
) -> MonteCarloSetup:
    """Samples of designed motions, best first: training, validation, test."""
    pi = document_robot(lib)
    runs = [samples_of(ideal(lib, m, Plant(pi), config.rate_hz), lib) for m in motions]
    scorer, train = scorer_of(lib, runs[2], pi, config.configurations), {"designed": runs[0]}
    return MonteCarloSetup(lib, config, lib.lam_from_pi(pi), train, runs[1], scorer)


def run_cases(setup: MonteCarloSetup, numbers: range, threads: int) -> list[Row]:
    """Fit all cases and methods of some trials; Adam runs all trials of a case in one C call."""
    solvers = {"lm": fit_from_map} | {name: ESTIMATORS[name].fit for name in ("map", "pc-ols")}
    rows: list[Row] = []
    for case in setup.config.cases:
        problems = [problem_of(setup, case, number) for number in numbers]
        for method in case.methods:
            if method in {"adam", "adam-zero"}:
                adam = setup.config.adam
                if method == "adam-zero":
                    adam = replace(adam, rule=replace(adam.rule, threshold=0.0))
                fits = _adam(setup, problems, threads, adam)
            elif method == "adam-frozen":
                fits = [_frozen(setup, problem) for problem in problems]
            else:
                fits = [(*timed(solvers[method], problem), []) for problem in problems]
            for number, problem, (fit, seconds, curve) in zip(numbers, problems, fits, strict=True):
                row: Row = {"case": case.name, "method": method, "trial": number}
                row |= row_of(setup.scorer, problem, fit) | {"time_s": seconds}
                if not case.noise:  # residuals are rounding errors, without an effective size
                    row.pop("n_eff", None)
                rows.append(row | ({"curve": curve} if curve else {}))
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


TimedFit = tuple[Fit, float, list[float]]  # a fit, its time [s], and its AIRM over the iterations


def _adam(
    setup: MonteCarloSetup, problems: Sequence[Problem], threads: int, preset: Preset
) -> list[TimedFit]:
    config, lib = setup.config, setup.lib
    places: list[list[Array]] = [[] for _ in problems]

    def seen(done: int, points: list[Array]) -> None:
        for place, x in zip(places, points, strict=True):
            place.append(x)

    fits = adam_of_all(problems, preset, threads, Watch(config.curve_every, seen))
    ended = []
    for problem, (fit, seconds), place in zip(problems, fits, places, strict=True):
        points = [problem.start, *place[: (fit.iterations or 0) // config.curve_every]]
        ended.append((fit, seconds, [setup.scorer.airm(lib.pi_from_lam(x)) for x in points]))
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
    near = problem.lib.lam_from_pi(ESTIMATORS["map"].fit(problem).pi)
    return ESTIMATORS["log-cholesky"].fit(replace(problem, start=near))


def row_of(scorer: Scorer, problem: Problem, fit: Fit) -> Row:
    """Metrics of one fit."""
    friction = scorer.test.friction(fit.phi) if fit.phi.size else None
    row: Row = {"status": fit.status} | scorer.row(fit.pi, friction, fit.unrepaired)
    row |= {"iterations": fit.iterations, "loss": problem.statistics().value(fit.pi, fit.phi)}
    return row | ({} if fit.n_eff is None else {"n_eff": fit.n_eff})
