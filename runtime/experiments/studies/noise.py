"""Sec. 5.1.3: noise on the torque of training and validation, p = 0.15."""

from runtime.experiments.curves import band, single
from runtime.experiments.montecarlo import METHODS, Case, Config, Setting, run_cases, setting_of
from runtime.experiments.montecarlo_facts import data_facts
from runtime.experiments.studies.ideal import MAIN, TORQUE
from runtime.experiments.study import Arrays, Finished, Row, Study, View
from runtime.library import Array, Library

SEVERE, THIRD = 0.1, 2
"""Noise in N·m and trial of Fig. 5.4; the last one where there are fewer."""
CASES = tuple(
    Case(
        f"sigma={sigma:g}",
        0.15,
        sigma,
        methods=("adam", "map", "pc-ols") + (("adam-frozen",) if sigma == SEVERE else ()),
    )
    for sigma in (0.01, 0.05, SEVERE)
)
NAMES = tuple(case.name for case in CASES)
WORST = NAMES[-1]


def prepare(lib: Library, config: Config, needed: Arrays) -> Setting:
    """The designed motions."""
    return setting_of(lib, config, needed)


def finish(setting: Setting, rows: list[Row]) -> Finished:
    """Bands of all cases, and the two ways of one trial."""
    config = setting.config
    every, last = config.curve_every, config.adam.rule.max_iterations
    series: dict[str, Array] = {}
    for case in config.cases:
        series |= band(rows, case.name, "adam", every, last)
    number = min(THIRD, max(row["trial"] for row in rows))
    for method in ("adam", "adam-frozen"):
        series |= single(rows, WORST, method, number, every)
    facts = data_facts(setting) | {
        "noise": "on the torque of training and validation; the test torque is exact",
        "frozen": "link 7 of adam-frozen starts at the truth and stays there, w_7 = 0",
        "trial_of_fig_5.4": number + 1,
    }
    return Finished(series, facts)


STUDY = Study(
    name="noise",
    title="Robustness against torque noise",
    config=Config(CASES),
    prepare=prepare,
    run=run_cases,
    finish=finish,
    cases={c.name: f"σ = {c.noise:g} N·m on the torque" for c in CASES},
    methods={name: METHODS[name] for name in ("adam", "map", "pc-ols", "adam-frozen")},
    needs=("excitation",),
    views=(
        View("table-5.6", "table", "Torque noise: final distances", NAMES, MAIN),
        View("table-5.7", "table", "Torque noise: torque errors, %", NAMES, TORQUE),
        View(
            "fig-5.4",
            "lines",
            "AIRM of one trial at 0.1 N·m: all links, and link 7 left out",
            cases=(WORST,),
            series=tuple(
                f"{WORST}/{method}/single_{part}"
                for method in ("adam", "adam-frozen")
                for part in ("iteration", "airm")
            ),
            axes=("iteration", "AIRM"),
        ),
    ),
)
