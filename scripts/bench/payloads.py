"""Repeated identification of a payload: errors, and coverage of the 95 % intervals."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from runtime import identify_payload
from runtime.estimators.regression.residuals import NORMAL_95
from runtime.excitation import Trajectory
from runtime.identification.payload.arm import arm_model
from runtime.identification.payload.body import mount_of
from runtime.library import Library
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed

Array = NDArray[np.float64]

NOISE = 0.05
COM = np.array([0.01, 0.02, 0.05])
SQUARES = np.array([0.1, 0.08, 0.06]) ** 2
TRUTH = np.array([1.0, *COM, *(SQUARES.sum() - SQUARES) / 12, 0.0, 0.0, 0.0])
"""A box of 1 kg and .1 × .08 × .06 m beside the flange: m, c, inertia about c."""


@dataclass(frozen=True, slots=True)
class Weighed:
    """RMS errors over trials, g and mm, and the coverage of the 95 % intervals."""

    grams: float
    millimetres: float
    coverage: float


def weigh(
    lib: Library, trajectory: Trajectory, count: int, cutoff: float | None, off: float = 0.0
) -> Weighed:
    """Identify a box from logs of 10 s at 100 Hz with white torque noise."""
    mount = mount_of(lib, lib.link_names[-1])
    body = np.zeros(10)
    body[:4] = TRUTH[0], *TRUTH[0] * COM
    steiner = TRUTH[0] * (COM @ COM * np.eye(3) - np.outer(COM, COM))
    about = np.diag(TRUTH[4:7]) + steiner
    body[4:] = *np.diag(about), about[0, 1], about[0, 2], about[1, 2]
    run = ideal(lib, trajectory, Plant(lib.pi0))
    columns = lib.regressor(run.q, run.dq, run.ddq)[:, :, mount.columns]
    box = columns @ np.linalg.solve(mount.to_frame, body)
    arm = replace(arm_model(lib), is_exact=not off)
    rng = np.random.default_rng(5)
    errors, held = [], []
    for _ in range(count):
        if off:
            run = ideal(lib, trajectory, Plant(perturbed(lib, lib.pi0, off, rng)))
        noise = NOISE * rng.normal(size=box.shape)
        if cutoff:
            b, a = signal.butter(4, cutoff / 50.0)
            noise = signal.filtfilt(b, a, noise, axis=0)
        payload = identify_payload(run.replace(tau=run.tau + box + noise), lib, arm=arm)
        errors.append(payload.body.values - TRUTH)
        held.append(np.abs(errors[-1]) < NORMAL_95 * payload.body.sigma)
    wrong = np.array(errors)
    return Weighed(
        1e3 * float(np.sqrt(np.mean(wrong[:, 0] ** 2))),
        1e3 * float(np.sqrt(np.mean(np.sum(wrong[:, 1:4] ** 2, axis=1)))),
        float(np.mean(held)),
    )
