"""Sec. 5.1.2: trained on plain sines or on the designed motion, p = 0.15, noise-free."""

from dataclasses import replace

from runtime.experiments.montecarlo import METHODS, Case, Config, Setting, run_cases, setting_of
from runtime.experiments.montecarlo_facts import data_facts
from runtime.experiments.motions import curves, sinusoidal
from runtime.experiments.studies.ideal import MAIN, TORQUE
from runtime.experiments.study import Arrays, Finished, Row, Study, View
from runtime.library import Library
from runtime.objective import samples_of
from runtime.recording import Recording

CASES = (Case("sinusoidal", 0.15, training="sinusoidal"), Case("optimised", 0.15))
NAMES = tuple(case.name for case in CASES)


def _sines(lib: Library, config: Config, setting: Setting) -> Recording:
    samples = setting.train["designed"]
    duration = (len(samples) - 1) / config.rate_hz
    recording, _ = sinusoidal(lib, duration, config.rate_hz, *config.sinusoid)
    pi = lib.pi_from_lam(setting.lam)
    assert recording.dq is not None  # noqa: S101  all derivatives are given
    assert recording.ddq is not None  # noqa: S101
    tau = lib.inverse_dynamics(recording.q, recording.dq, recording.ddq, pi)
    return recording.replace(tau=tau)


def prepare(lib: Library, config: Config, needed: Arrays) -> Setting:
    """The sines beside the designed motion."""
    setting = setting_of(lib, config, needed)
    sines = samples_of(_sines(lib, config, setting), lib)
    return replace(setting, train={"sinusoidal": sines, **setting.train})


def finish(setting: Setting, rows: list[Row]) -> Finished:
    """The motion of Fig. A.1."""
    del rows
    lib, config = setting.lib, setting.config
    recording, amplitude = sinusoidal(lib, 1.0, config.rate_hz, *config.sinusoid)
    del recording
    facts = data_facts(setting) | {
        "sinusoid": f"q = default pose + b sin(2 t + phase), b = {config.sinusoid[0]:g} of the "
        "largest within the limits, phases from their seed; the document gives neither, so "
        "Table 5.4 need not come out",
        "sinusoid_amplitude": amplitude.tolist(),
        "sinusoid_seed": config.sinusoid[1],
    }
    return Finished(curves("sine", _sines(lib, config, setting)), facts)


STUDY = Study(
    name="sinusoid",
    title="Sinusoidal against optimised training trajectory",
    config=Config(CASES),
    prepare=prepare,
    run=run_cases,
    finish=finish,
    cases={"sinusoidal": "trained on sines of 2 rad/s", "optimised": "trained on the best design"},
    methods={name: METHODS[name] for name in ("adam", "lm")},
    needs=("excitation",),
    views=(
        View("table-5.4", "table", "Sines against design: final distances", NAMES, MAIN),
        View("table-5.5", "table", "Sines against design: torque errors, %", NAMES, TORQUE),
        View(
            "fig-A.1",
            "motion",
            "The sinusoidal training trajectory",
            series=("sine_t", "sine_q", "sine_dq", "sine_ddq", "sine_tau"),
            axes=("time [s]", ""),
        ),
    ),
)
