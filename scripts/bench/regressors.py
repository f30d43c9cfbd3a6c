"""Cut-offs with and without accelerations: simulated logs that are hard to differentiate, a Panda.

The simulated arm is the document's, with friction and 0.05 N·m of noise; the log holds q and τ.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import runtime
from bench.trials import trajectories
from runtime import Recording
from runtime.estimators.regression.samples import samples_of
from runtime.experiments.trials.motions import document_robot
from runtime.identification import metrics
from runtime.library import Library
from runtime.recording import Friction, Preparation
from runtime.simulation import Plant, ideal

CUTOFFS = (1.0, 2.0, 3.0, 5.0, 10.0)
FORMS = ("acceleration", "momentum")
TRIALS = 5
BELOW_RATE = 0.45


@dataclass(frozen=True, slots=True)
class Line:
    """One log and regressor: an error in % per cut-off, None where the rate is too low for it."""

    log: str
    regressor: str
    errors: tuple[float | None, ...]


def lines(lib: Library, designs: Path) -> Iterator[Line]:
    """Errors of base parameters, then torque errors on the last 40 % of panda_gaz."""
    hard = (("100 Hz, encoders of 256 counts", 100.0, 256), ("12.5 Hz", 12.5, None))
    for name, rate, counts in hard:
        for form in FORMS:
            errors_of = (simulated(lib, designs, rate, counts, form, f_c) for f_c in CUTOFFS)
            yield Line(f"{name}: base parameters", form, tuple(errors_of))
    log = runtime.read_recording("panda_gaz")
    for form in FORMS:
        errors_of = (of_panda(lib, log, form, f_c) for f_c in CUTOFFS)
        yield Line("Panda: low-passed torque", form, tuple(errors_of))


def simulated(
    lib: Library, designs: Path, rate: float, counts: int | None, form: str, cutoff: float
) -> float | None:
    """Mean of 100 ‖β̂ − β‖/‖β‖ over noises."""
    if cutoff > BELOW_RATE * rate:
        return None
    pi = document_robot(lib)
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    beta, errors = lib.base_matrix @ pi, []
    usual = Preparation(filter="butterworth", cutoff_hz=cutoff, trim_s=0.5, regressor=form)
    for seed in range(TRIALS):
        rng = np.random.default_rng(seed)
        runs = []
        for design in trajectories(designs, lib):
            run = ideal(lib, design, plant, rate_hz=rate, rng=rng)
            q = run.q if counts is None else np.round(run.q * counts / 2 / np.pi)
            q = q if counts is None else q * 2 * np.pi / counts
            runs.append(run.replace(q=q, dq=None, ddq=None))
        result = runtime.identify(
            runs[0],
            lib,
            preparation=usual,
            friction_columns=Friction(),
            validation=runs[1],
            test=runs[-1],
            certify=False,
        )
        errors.append(100 * np.linalg.norm(result.beta - beta) / np.linalg.norm(beta))
    return float(np.mean(errors))


def of_panda(lib: Library, log: Recording, form: str, cutoff: float) -> float:
    """Overall error of the torque low-passed at the same cut-off."""
    known = log.recipe.preparation if log.recipe else Preparation()
    usual = replace(known, filter="butterworth", cutoff_hz=cutoff, regressor=form)
    result = runtime.identify(log, lib, preparation=usual, certify=False)
    tau = samples_of(result.test, lib).tau
    return metrics.torque_error(tau, result.predict_recording(result.test)).overall
