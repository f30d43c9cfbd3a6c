"""Sensors of the FR3 with known gains and biases, and a payload that was weighed."""

import numpy as np

from runtime.identification.payload.body import KnownPayload
from runtime.recording import Friction

GAINS = np.array([1.05, 0.97, 1.02, 0.93, 1.1, 0.95, 1.03])
BIAS = np.array([[0.3, -0.2, 0.1, 0.5, -0.1, 0.05, 1.2], [-0.3, 0.2, 0.4, 0.1, 0.1, 0.15, -0.8]])
NOISE, TRIALS, WIDTH = 0.05, 120, 0.05
TERMS = Friction(("viscous", "coulomb"), coulomb_speed=WIDTH)
COM, INERTIA = np.array([0.01, 0.02, 0.05]), np.diag([0.004, 0.005, 0.003])
BODY = KnownPayload(3.0, COM, INERTIA)
POINT = KnownPayload(3.0, COM)


def measured(runs, noise=None, gains=GAINS, bias=BIAS):
    """What sensors with these gains and biases read."""
    errors = np.zeros((2, *runs[0].tau.shape)) if noise is None else noise
    return tuple(
        run.replace(tau=gains * (run.tau + b) + e)
        for run, b, e in zip(runs, bias, errors, strict=True)
    )
