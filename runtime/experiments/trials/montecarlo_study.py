"""Studies of the Monte Carlo of the document (Sec. 5.1): cases, series and views."""

from collections.abc import Callable, Mapping
from typing import Any

from runtime.experiments.study import Arrays, Row, Study, StudyOutcome, View
from runtime.experiments.trials.curves import band
from runtime.experiments.trials.montecarlo import (
    METHODS,
    Case,
    MonteCarloConfig,
    MonteCarloSetup,
    run_cases,
    setup_of,
)
from runtime.experiments.trials.motions import condition
from runtime.experiments.trials.scores import torque_rms
from runtime.experiments.views import torque_table
from runtime.library import Array, Library

MAIN = (
    *("airm", "frobenius_rms", "base_error", "iterations", "time_s", "consistent"),
    *("strict", "smallest_eigenvalue"),
)
"""Rows of Tables 5.2, 5.4 and 5.6."""


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
    return (
        View(distances, "table", f"{title}: final distances", columns, MAIN),
        torque_table(torques, title, columns),
    )


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
