"""Long motions of a robot for tests of long and of several logs."""

import numpy as np

from runtime import Recording
from runtime.library import Library

VISCOUS, COULOMB, SPEED = 0.5, 0.3, 0.02


def moving(
    lib: Library, rows: int, rate: float = 500.0, payload: np.ndarray | None = None
) -> Recording:
    """Sums of sines about the robot's middle, with friction, 0.05 N·m of noise and a payload."""
    rng = np.random.default_rng(5)
    limits = lib.limits()
    middle, half = (limits["lower"] + limits["upper"]) / 2, (limits["upper"] - limits["lower"]) / 2
    t = np.arange(rows) / rate
    speed = 2 * np.pi * rng.uniform(0.1, 0.5, (lib.n_joints, 4))
    phase = t[:, None, None] * speed + rng.uniform(0, 6, speed.shape)
    size = half[:, None] * 0.2
    q = middle + np.sum(size * np.sin(phase), axis=2)
    dq = np.sum(size * speed * np.cos(phase), axis=2)
    ddq = -np.sum(size * speed**2 * np.sin(phase), axis=2)
    pi = lib.pi0 if payload is None else lib.pi0 + payload
    tau = lib.inverse_dynamics(q, dq, ddq, pi) + VISCOUS * dq + COULOMB * np.tanh(dq / SPEED)
    return Recording(t=t, q=q, dq=dq, tau=tau + rng.normal(0, 0.05, q.shape), name="x")
