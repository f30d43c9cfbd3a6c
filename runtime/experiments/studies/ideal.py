"""Sec. 5.1.1: noise-free data, three perturbations of the initial guess."""

from runtime.experiments.study import Row, StudyOutcome, View
from runtime.experiments.trials.montecarlo import Case, MonteCarloSetup
from runtime.experiments.trials.montecarlo_study import bands, data_facts, final_tables, monte_carlo

CASES = {
    Case(f"p={p:g}", p): f"initial guess perturbed by {100 * p:g} %" for p in (0.05, 0.15, 0.25)
}


def _finish(setup: MonteCarloSetup, rows: list[Row]) -> StudyOutcome:
    """Mean AIRM over the iterations of Adam."""
    return StudyOutcome(bands(setup, rows), data_facts(setup))


def figure(name: str, case: Case) -> View:
    """View of one of Figs. 5.1 to 5.3."""
    return View(
        name,
        "band",
        f"AIRM over the iterations of λ-Adam, p = {case.perturbation:g}",
        cases=(case.name,),
        series=tuple(f"{case.name}/adam/{part}" for part in ("iteration", "mean", "std")),
        axes=("iteration", "AIRM"),
    )


STUDY = monte_carlo(
    "ideal",
    "Ideal case: noise-free data, perturbed initial guess",
    CASES,
    _finish,
    views=(
        *final_tables(("table-5.2", "table-5.3"), "Ideal conditions", CASES),
        *(figure(f"fig-5.{k}", case) for k, case in enumerate(CASES, start=1)),
    ),
)
