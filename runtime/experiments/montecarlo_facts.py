"""What must be reported of the data of a Monte Carlo."""

from typing import Any

import numpy as np

from runtime.experiments.montecarlo import Setting
from runtime.experiments.motions import condition


def data_facts(setting: Setting) -> dict[str, Any]:
    """Rates and counts, filter, friction, weights, torque RMS per joint, condition numbers."""
    lib, config = setting.lib, setting.config
    parts = {**setting.train, "validation": setting.held, "test": setting.judge.test}
    return {
        "rate_hz": config.rate_hz,
        "samples": {name: len(samples) for name, samples in parts.items()},
        "filter": "none: motion and torque are exact, noise is added to the torque alone",
        "delay": "none",
        "friction_columns": [],
        "weights": "Eq. 4.8 from the training torque of every trial, mean 1",
        "torque_rms": {
            name: np.sqrt(np.mean(samples.tau**2, axis=0)).tolist()
            for name, samples in parts.items()
        },
        "condition_numbers": {name: condition(lib, samples) for name, samples in parts.items()},
        "condition_columns": f"{len(lib.base_columns)} base parameters, columns of unit length, "
        f"all samples at {config.rate_hz:g} Hz",
        "seed": config.seed,
        "configurations": f"{config.configurations} equally spaced on the test trajectory",
    }
