"""Tables 5.2 and 5.3 over 20 designs of the motions: how much the choice of one design matters.

The document does not state its motions. The other studies use one design, whose torque errors are
closest to those of the document; here every seed from 0 has its design, training on the best of its
starts. A row is the mean of the trials of one design.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.estimators.regression.samples import samples_of
from runtime.excitation.search.design_settings import SearchProblem
from runtime.excitation.search.finish import repaired
from runtime.excitation.search.single_start import Search
from runtime.experiments.study import TORQUE, Arrays, Row, Study, StudyOutcome, View
from runtime.experiments.trials.montecarlo import (
    METHODS,
    Case,
    MonteCarloConfig,
    MonteCarloSetup,
    run_cases,
)
from runtime.experiments.trials.motions import ROLES, document_robot
from runtime.experiments.trials.scores import scorer_of
from runtime.library import Array, Library
from runtime.simulation import Plant, ideal

DESIGNS = 20
"""Number of designs; their seeds are the numbers from `DesignsConfig.seed` · 20 on."""
BOTH = ("adam", "adam-zero")
CASES = {
    Case(f"p={p:g}", p, methods=BOTH): f"initial guess perturbed by {100 * p:g} %"
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
    del needed
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
                head = {"case": case.name, "method": method, "trial": number}
                rows.append(head | _means(same))
    return rows


def _finish(setup: tuple[Library, DesignsConfig], rows: list[Row]) -> StudyOutcome:
    """Facts of the designs; there are no series."""
    del rows
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
    problem = SearchProblem(
        lib.folder, lib.level, lib.home, config.harmonics, config.duration, seed
    )
    search = Search(lib, problem)
    ended: list[tuple[float, Array]] = [search.start(k) for k in range(config.starts)]
    best = sorted(ended, key=lambda each: each[0])[: len(ROLES)]
    motions = [repaired(lib, search, search.refined(a)).trajectory for _, a in best]
    pi, of_trials = document_robot(lib), MonteCarloConfig(config.cases, config.seed)
    runs = [samples_of(ideal(lib, m, Plant(pi), of_trials.rate_hz), lib) for m in motions]
    scorer = scorer_of(lib, runs[2], pi, of_trials.configurations)
    train = {"designed": runs[0]}
    return MonteCarloSetup(lib, of_trials, lib.lam_from_pi(pi), train, runs[1], scorer)


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


STUDY = Study(
    name="designs",
    title="Ideal case over 20 designs of the motions",
    config=DesignsConfig(),
    prepare=_prepare,
    run=_run,
    finish=_finish,
    cases={case.name: sentence for case, sentence in CASES.items()},
    methods={method: METHODS[method] for method in BOTH},
    trials=DESIGNS,
    per_chunk=1,
    views=(
        _table("table-5.2", "Final distances over 20 designs", DISTANCES),
        _table("table-5.3", "Torque errors over 20 designs, %", TORQUE),
    ),
)
