"""Sec. 5.1.3: noise on the torque of training and validation, p = 0.15."""

from runtime.experiments.study import Row, StudyOutcome, View
from runtime.experiments.trials.curves import single
from runtime.experiments.trials.montecarlo import Case, MonteCarloSetup
from runtime.experiments.trials.montecarlo_study import bands, data_facts, final_tables, monte_carlo

SEVERE, THIRD = 0.1, 2
"""Noise [N·m] and trial of Fig. 5.4, or the last trial where there are fewer."""
WORST = f"sigma={SEVERE:g}"
BOTH = ("adam", "adam-frozen")
"""Methods of Fig. 5.4."""


def _case(sigma: float) -> Case:
    frozen = BOTH[1:] if sigma == SEVERE else ()
    return Case(
        f"sigma={sigma:g}", 0.15, sigma, methods=("adam", "adam-zero", "map", "pc-ols", *frozen)
    )


CASES = {_case(sigma): f"σ = {sigma:g} N·m on the torque" for sigma in (0.01, 0.05, SEVERE)}


def _finish(setup: MonteCarloSetup, rows: list[Row]) -> StudyOutcome:
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


STUDY = monte_carlo(
    "noise",
    "Robustness against torque noise",
    CASES,
    _finish,
    views=(
        *final_tables(("table-5.6", "table-5.7"), "Torque noise", CASES),
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
