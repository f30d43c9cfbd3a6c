"""Sec. 5.1.1: noise-free data, three sizes of the first guess's error."""

from runtime.experiments.curves import band
from runtime.experiments.montecarlo import METHODS, Case, Config, Setting, run_cases, setting_of
from runtime.experiments.montecarlo_facts import data_facts
from runtime.experiments.study import Arrays, Finished, Row, Study, View
from runtime.library import Array, Library

CASES = tuple(Case(f"p={p:g}", p) for p in (0.05, 0.15, 0.25))
NAMES = tuple(case.name for case in CASES)
MAIN = ("airm", "frobenius_rms", "iterations", "time_s", "consistent")
"""Lines of Tables 5.2, 5.4 and 5.6."""
TORQUE = tuple(f"tau_error_{joint}" for joint in range(1, 8))
"""Lines of Tables 5.3, 5.5 and 5.7."""


def prepare(lib: Library, config: Config, needed: Arrays) -> Setting:
    """No motion beyond the designed ones."""
    return setting_of(lib, config, needed)


def finish(setting: Setting, rows: list[Row]) -> Finished:
    """The mean AIRM over the iterations of Adam."""
    config = setting.config
    last, series = config.adam.rule.max_iterations, dict[str, Array]()
    for case in config.cases:
        series |= band(rows, case.name, "adam", config.curve_every, last)
    return Finished(series, data_facts(setting))


def figure(name: str, case: Case) -> View:
    """One of Figs. 5.1 to 5.3."""
    return View(
        name,
        "band",
        f"AIRM on the way of λ-Adam, p = {case.perturbation:g}",
        cases=(case.name,),
        series=tuple(f"{case.name}/adam/{part}" for part in ("iteration", "mean", "std")),
        axes=("iteration", "AIRM"),
    )


STUDY = Study(
    name="ideal",
    title="Ideal case: noise-free data, perturbed first guess",
    config=Config(CASES),
    prepare=prepare,
    run=run_cases,
    finish=finish,
    cases={c.name: f"first guess perturbed by {100 * c.perturbation:g} %" for c in CASES},
    methods={name: METHODS[name] for name in ("adam", "lm")},
    needs=("excitation",),
    views=(
        View("table-5.2", "table", "Ideal conditions: final distances", NAMES, MAIN),
        View("table-5.3", "table", "Ideal conditions: torque errors, %", NAMES, TORQUE),
        *(figure(f"fig-5.{k}", case) for k, case in enumerate(CASES, start=1)),
    ),
)
