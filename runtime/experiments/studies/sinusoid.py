"""Sec. 5.1.2: training on sines or on the designed motion, p = 0.15, noise-free."""

from dataclasses import replace

from runtime.estimators.regression.samples import samples_of
from runtime.experiments.study import Arrays, Row, StudyOutcome
from runtime.experiments.trials.montecarlo import Case, MonteCarloConfig, MonteCarloSetup, setup_of
from runtime.experiments.trials.montecarlo_study import data_facts, final_tables, monte_carlo
from runtime.experiments.trials.motions import curves, sinusoidal
from runtime.experiments.views import motion
from runtime.library import Library
from runtime.recording import Recording

CASES = {
    Case("sinusoidal", 0.15, training="sinusoidal"): "trained on sines of 2 rad/s",
    Case("optimised", 0.15): "trained on the best design",
}


def _sines(lib: Library, config: MonteCarloConfig, setup: MonteCarloSetup) -> Recording:
    samples = setup.train["designed"]
    duration = (len(samples) - 1) / config.rate_hz
    recording, _ = sinusoidal(lib, duration, config.rate_hz, *config.sinusoid)
    pi = lib.pi_from_lam(setup.lam)
    motion = (recording.q, recording.required("dq"), recording.required("ddq"))
    tau = lib.inverse_dynamics(*motion, pi)
    return recording.replace(tau=tau)


def _prepare(lib: Library, config: MonteCarloConfig, needed: Arrays) -> MonteCarloSetup:
    """Add samples of the sinusoidal motion to those of the designed motions."""
    setup = setup_of(lib, config, needed)
    sines = samples_of(_sines(lib, config, setup), lib)
    return replace(setup, train={"sinusoidal": sines, **setup.train})


def _finish(setup: MonteCarloSetup, rows: list[Row]) -> StudyOutcome:
    """Motion of Fig. A.1."""
    del rows
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


STUDY = monte_carlo(
    "sinusoid",
    "Sinusoidal against optimised training trajectory",
    CASES,
    _finish,
    views=(
        *final_tables(("table-5.4", "table-5.5"), "Sines against design", CASES),
        motion("fig-A.1", "The sinusoidal training trajectory", "sine"),
    ),
    prepare=_prepare,
)
