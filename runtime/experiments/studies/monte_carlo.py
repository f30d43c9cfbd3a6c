"""Monte Carlo studies of the document (Sec. 5.1): ideal case, noise, sines as motion, 20 designs.

The document does not state its motions. The other studies use one design, whose torque errors are
closest to those of the document; here every seed from 0 has its design, training on the best of its
starts. A row is the mean of the trials of one design.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import samples_of
from runtime.excitation.search.design import repaired
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.single_start import Search
from runtime.experiments.study import (
    TORQUE,
    Arrays,
    Row,
    Study,
    StudyOutcome,
    View,
    motion,
    torque_table,
)
from runtime.experiments.trials import (
    METHODS,
    ROLES,
    Case,
    MonteCarloConfig,
    MonteCarloSetup,
    condition,
    curves,
    document_robot,
    run_cases,
    setup_along,
    setup_of,
    sinusoidal,
    torque_rms,
)
from runtime.library import Array, Library
from runtime.recording import Recording


def band(rows: Sequence[Row], case: str, method: str, every: int, last: int) -> dict[str, Array]:
    """Mean and σ of the AIRM over the iterations; a trial that has ended keeps its last value."""
    chosen = [row for row in rows if row["case"] == case and row["method"] == method]
    grid = np.arange(0, last + 1, every)
    lines = np.empty((len(chosen), grid.size))
    for line, row in zip(lines, chosen, strict=True):
        curve = np.array([*row["curve"], row["airm"]])
        line[:] = curve[np.minimum(np.arange(grid.size), len(curve) - 1)]
    name = f"{case}/{method}"
    std = lines.std(axis=0, ddof=1) if len(chosen) > 1 else np.zeros(grid.size)
    return {f"{name}/iteration": grid, f"{name}/mean": lines.mean(axis=0), f"{name}/std": std}


def single(
    rows: Sequence[Row], case: str, method: str, number: int, every: int
) -> dict[str, Array]:
    """AIRM of one trial over the iterations, up to its result."""
    for row in rows:
        if (row["case"], row["method"], row["trial"]) == (case, method, number):
            curve = np.array([*row["curve"], row["airm"]])
            name = f"{case}/{method}/single"
            grid = np.minimum(np.arange(len(curve)) * every, row["iterations"])
            return {f"{name}_iteration": grid, f"{name}_airm": curve}
    raise IdentificationError(
        f"expected a trial {number} of '{case}' by '{method}', got none; increase --trials"
    )


MAIN = (  # rows of Tables 5.2, 5.4 and 5.6
    *("airm", "frobenius_rms", "base_error", "iterations", "time_s", "consistent"),
    *("strict", "smallest_eigenvalue"),
)


def monte_carlo(
    name: str,
    title: str,
    cases: Mapping[Case, str],
    finish: Callable[[MonteCarloSetup, list[Row]], StudyOutcome],
    views: tuple[View, ...],
    prepare: Callable[[Library, MonteCarloConfig, Arrays], MonteCarloSetup] = setup_of,
) -> Study:
    """Study with the methods of its cases and the motions of the excitation study."""
    used = {method for case in cases for method in case.methods}
    return Study(
        name=name,
        title=title,
        config=MonteCarloConfig(tuple(cases)),
        prepare=prepare,
        run=run_cases,
        finish=finish,
        cases={case.name: sentence for case, sentence in cases.items()},
        methods={method: sentence for method, sentence in METHODS.items() if method in used},
        needs=("excitation",),
        views=views,
    )


def final_tables(
    names: tuple[str, str], title: str, cases: Mapping[Case, str]
) -> tuple[View, View]:
    """Views of the final results of every case: distances from the truth, torque errors."""
    columns = tuple(case.name for case in cases)
    distances, torques = names
    final = View(distances, "table", f"{title}: final distances", columns, MAIN)
    return (final, torque_table(torques, title, columns))


def bands(setup: MonteCarloSetup, rows: list[Row]) -> dict[str, Array]:
    """Mean AIRM over the iterations of Adam, of every case."""
    config, series = setup.config, dict[str, Array]()
    for case in config.cases:
        last = config.adam.rule.max_iterations
        series |= band(rows, case.name, "adam", config.curve_every, last)
    return series


def data_facts(setup: MonteCarloSetup) -> dict[str, Any]:
    """Facts of the data: rate, counts, weights, torque RMS, condition numbers."""
    lib, config = setup.lib, setup.config
    parts = {**setup.train, "validation": setup.held, "test": setup.scorer.test}
    return {
        "rate_hz": config.rate_hz,
        "samples": {name: len(samples) for name, samples in parts.items()},
        "filter": "none: motion and torque are exact, noise is added to the torque alone",
        "delay": "none",
        "friction_columns": [],
        "weights": "Eq. 4.8 from the training torque of every trial, mean 1",
        "torque_rms": {name: torque_rms(samples.tau).tolist() for name, samples in parts.items()},
        "condition_numbers": {name: condition(lib, samples) for name, samples in parts.items()},
        "condition_columns": f"{len(lib.base_columns)} base parameters, columns of unit length, "
        f"all samples at {config.rate_hz:g} Hz",
        "seed": config.seed,
        "configurations": f"{config.configurations} equally spaced on the test trajectory",
    }


IDEAL_CASES = {
    Case(f"p={p:g}", p): f"initial guess perturbed by {100 * p:g} %" for p in (0.05, 0.15, 0.25)
}


def _figure(name: str, case: Case) -> View:
    """View of one of Figs. 5.1 to 5.3."""
    return View(
        name,
        "band",
        f"AIRM over the iterations of λ-Adam, p = {case.perturbation:g}",
        cases=(case.name,),
        series=tuple(f"{case.name}/adam/{part}" for part in ("iteration", "mean", "std")),
        axes=("iteration", "AIRM"),
    )


IDEAL = monte_carlo(  # Sec. 5.1.1: noise-free data, three perturbations of the initial guess
    "ideal",
    "Ideal case: noise-free data, perturbed initial guess",
    IDEAL_CASES,
    lambda setup, rows: StudyOutcome(bands(setup, rows), data_facts(setup)),
    views=(
        *final_tables(("table-5.2", "table-5.3"), "Ideal conditions", IDEAL_CASES),
        *(_figure(f"fig-5.{k}", case) for k, case in enumerate(IDEAL_CASES, start=1)),
    ),
)

SEVERE, THIRD = 0.1, 2  # noise [N·m] and trial of Fig. 5.4, or the last trial where there are fewer
WORST = f"sigma={SEVERE:g}"
BOTH = ("adam", "adam-frozen")  # methods of Fig. 5.4


def _noise_case(sigma: float) -> Case:
    frozen = BOTH[1:] if sigma == SEVERE else ()
    methods = ("adam", "adam-zero", "map", "pc-ols", *frozen)
    return Case(f"sigma={sigma:g}", 0.15, sigma, methods=methods)


NOISE_CASES = {
    _noise_case(sigma): f"σ = {sigma:g} N·m on the torque" for sigma in (0.01, 0.05, SEVERE)
}


def _noise_finish(setup: MonteCarloSetup, rows: list[Row]) -> StudyOutcome:
    """Bands of all cases, and both curves of one trial."""
    series = bands(setup, rows)
    number = min(THIRD, max(row["trial"] for row in rows))
    for method in BOTH:
        series |= single(rows, WORST, method, number, setup.config.curve_every)
    facts = data_facts(setup) | {
        "noise": "on the torque of training and validation; the test torque is exact",
        "frozen": "link 7 of adam-frozen starts at the truth and stays there, w_7 = 0",
        "trial_of_fig_5.4": number + 1,
    }
    return StudyOutcome(series, facts)


NOISE = monte_carlo(  # Sec. 5.1.3: noise on the torque of training and validation, p = 0.15
    "noise",
    "Robustness against torque noise",
    NOISE_CASES,
    _noise_finish,
    views=(
        *final_tables(("table-5.6", "table-5.7"), "Torque noise", NOISE_CASES),
        View(
            "fig-5.4",
            "lines",
            f"AIRM of one trial at {SEVERE:g} N·m: all links, and without link 7",
            cases=(WORST,),
            series=tuple(
                f"{WORST}/{method}/single_{part}"
                for method in BOTH
                for part in ("iteration", "airm")
            ),
            axes=("iteration", "AIRM"),
        ),
    ),
)

SINES_CASES = {
    Case("sinusoidal", 0.15, training="sinusoidal"): "trained on sines of 2 rad/s",
    Case("optimised", 0.15): "trained on the best design",
}


def _sines(lib: Library, config: MonteCarloConfig, setup: MonteCarloSetup) -> Recording:
    duration = (len(setup.train["designed"]) - 1) / config.rate_hz
    recording, _ = sinusoidal(lib, duration, config.rate_hz, *config.sinusoid)
    pi = lib.pi_from_lam(setup.lam)
    states = (recording.q, recording.required("dq"), recording.required("ddq"))
    return recording.replace(tau=lib.inverse_dynamics(*states, pi))


def _sines_prepare(lib: Library, config: MonteCarloConfig, needed: Arrays) -> MonteCarloSetup:
    """Add samples of the sinusoidal motion to those of the designed motions."""
    setup = setup_of(lib, config, needed)
    sines = samples_of(_sines(lib, config, setup), lib)
    return replace(setup, train={"sinusoidal": sines, **setup.train})


def _sines_finish(setup: MonteCarloSetup, rows: list[Row]) -> StudyOutcome:
    """Motion of Fig. A.1."""
    lib, config = setup.lib, setup.config
    _, amplitude = sinusoidal(lib, 1.0, config.rate_hz, *config.sinusoid)
    facts = data_facts(setup) | {
        "sinusoid": f"q = default pose + b sin(2 t + phase), b = {config.sinusoid[0]:g} of the "
        "largest within the limits, phases from their seed; the document states neither, so that "
        "Table 5.4 may differ",
        "sinusoid_amplitude": amplitude.tolist(),
        "sinusoid_seed": config.sinusoid[1],
    }
    return StudyOutcome(curves("sine", _sines(lib, config, setup)), facts)


SINES = monte_carlo(  # Sec. 5.1.2: training on sines or the designed motion, p = 0.15, noise-free
    "sinusoid",
    "Sinusoidal against optimised training trajectory",
    SINES_CASES,
    _sines_finish,
    views=(
        *final_tables(("table-5.4", "table-5.5"), "Sines against design", SINES_CASES),
        motion("fig-A.1", "The sinusoidal training trajectory", "sine"),
    ),
    prepare=_sines_prepare,
)

DESIGNS = 20  # number of designs; their seeds are the numbers from `DesignsConfig.seed` · 20 on
THRESHOLDS = ("adam", "adam-zero")
CASES = {
    Case(f"p={p:g}", p, methods=THRESHOLDS): f"initial guess perturbed by {100 * p:g} %"
    for p in (0.05, 0.15, 0.25)
}
DISTANCES = ("airm", "frobenius_rms", "base_error", "iterations", "strict")
"""Rows of the table beside Table 5.2."""


@dataclass(frozen=True, slots=True)
class DesignsConfig:
    """Settings of the excitation study, and the number of trials of each design."""

    seed: int = 0  # first of the seeds over 20
    trials: int = 30  # number of trials of each design
    starts: int = 5  # starts of each search
    harmonics: int = 5
    duration: float = 10.0
    cases: tuple[Case, ...] = tuple(CASES)


def _prepare(lib: Library, config: DesignsConfig, needed: Arrays) -> tuple[Library, DesignsConfig]:
    """Robot and config; every design is a trial."""
    document_robot(lib)  # refuses other robots
    return lib, config


def _run(setup: tuple[Library, DesignsConfig], numbers: range, threads: int) -> list[Row]:
    """Means over the trials of some designs."""
    lib, config = setup
    rows: list[Row] = []
    for number in numbers:
        monte_carlo = _setup(lib, config, DESIGNS * config.seed + number)
        trials = run_cases(monte_carlo, range(config.trials), threads)
        for case in config.cases:
            for method in case.methods:
                same = [r for r in trials if (r["case"], r["method"]) == (case.name, method)]
                rows.append({"case": case.name, "method": method, "trial": number} | _means(same))
    return rows


def _finish(setup: tuple[Library, DesignsConfig], rows: list[Row]) -> StudyOutcome:
    """Facts of the designs; there are no series."""
    config = setup[1]
    first = DESIGNS * config.seed
    facts: dict[str, Any] = {
        "designs": f"seeds {first} to {first + DESIGNS - 1}, none left out",
        "trials_per_design": config.trials,
        "figures": "median [first to third quartile] of the means of the designs",
    }
    return StudyOutcome(facts=facts)


def _setup(lib: Library, config: DesignsConfig, seed: int) -> MonteCarloSetup:
    """Samples of the best three motions of a design: training, validation, test."""
    search = Search(lib, DesignSettings(config.duration, config.harmonics, seed=seed))
    ended: list[tuple[float, Array]] = [search.start(k) for k in range(config.starts)]
    best = sorted(ended, key=lambda each: each[0])[: len(ROLES)]
    motions = [repaired(search, search.refined(a)).trajectory for _, a in best]
    return setup_along(lib, MonteCarloConfig(config.cases, config.seed), motions)


def _means(rows: list[Row]) -> Row:
    """Means of the figures of several trials, and whether all of them are consistent."""
    figures = (*DISTANCES, "time_s", *TORQUE)
    names = [name for name in figures if all(name in row for row in rows)]
    means: Row = {name: float(np.mean([row[name] for row in rows])) for name in names}
    return means | {"consistent": all(row["consistent"] for row in rows)}


def _table(name: str, title: str, metrics: tuple[str, ...]) -> View:
    cases = tuple(case.name for case in CASES)
    return View(
        f"{name}-designs", "table", title, cases, metrics, document=name, spread="quartiles"
    )


OVER_DESIGNS = Study(
    name="designs",
    title="Ideal case over 20 designs of the motions",
    config=DesignsConfig(),
    prepare=_prepare,
    run=_run,
    finish=_finish,
    cases={case.name: sentence for case, sentence in CASES.items()},
    methods={method: METHODS[method] for method in THRESHOLDS},
    trials=DESIGNS,
    per_chunk=1,
    views=(
        _table("table-5.2", "Final distances over 20 designs", DISTANCES),
        _table("table-5.3", "Torque errors over 20 designs, %", TORQUE),
    ),
)
