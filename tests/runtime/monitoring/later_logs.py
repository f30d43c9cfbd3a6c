"""Later logs of an arm on which something has changed."""

import numpy as np

from runtime import Recording
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.simulation import Plant, ideal
from runtime.simulation.box_payload import Box
from runtime.simulation.virtual_robot import perturbed

FRICTION = {"viscous": 0.5, "coulomb": 0.3}
NOISE = 0.05


def later_log(
    lib: Library, trajectory: Trajectory, pi: np.ndarray, change: str, seed: int = 2
) -> Recording:
    """Another motion of the arm after a change."""
    friction = {
        key: 1.2 * value if change == "friction" else value for key, value in FRICTION.items()
    }
    if change == "payload":
        pi = pi + Box(0.2, (0.0, 0.0, 0.1), (0.05,) * 3, "fr3_link7").pi(lib)
    if change in {"links", "link and sensor"}:
        pi = pi + Box(0.3, (0.03, 0.0, 0.06), (0.08,) * 3, "fr3_link4").pi(lib)
    if change == "model":
        pi = perturbed(lib, pi, 0.1, np.random.default_rng(3))
    log = ideal(
        lib, trajectory, Plant(pi, **friction, torque_noise=NOISE), rng=np.random.default_rng(seed)
    )
    tau = log.tau.copy()
    if change == "sensor gain":
        tau[:, 2] *= 1.05
    if change == "sensor bias":
        tau[:, 4] += 0.1
    if change == "sensor bias of all":
        tau += 0.15 * np.array([1, -1, 1, -1, 1, -1, 1])
    elapsed = (log.t - log.t[0]) / (log.t[-1] - log.t[0])
    if change == "sensor drift":
        tau[:, 4] += 0.2 * elapsed
    if change == "warming":
        viscous, dry = FRICTION["viscous"] * log.dq, FRICTION["coulomb"] * np.sign(log.dq)
        tau -= 0.3 * (elapsed[:, None] - 0.5) * (viscous + dry)
    if change == "link and sensor":
        tau[:, 5] += 0.2
    if change == "clock":
        tau = np.stack([np.interp(log.t - 0.005, log.t, row) for row in tau.T], axis=1)
    return log.replace(tau=tau)
