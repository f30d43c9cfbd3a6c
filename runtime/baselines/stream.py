"""What the filters work on: the recording at its full rate, its noise, the friction in their state.

Measured torque is their input and measured position their output; the state is
[q, dq, parameters], and one step of dt is semi-implicit in friction,

    dq⁺ = dq + dt (M + dt D)⁻¹ (τ − h − f),   q⁺ = q + dt dq,   D = ∂f/∂dq,

because smooth Coulomb friction on a light wrist is far too fast for an explicit one.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.preprocessing.segments import segments, uniform_step
from runtime.problem import Problem

SLOWEST = 200.0
"""Hz below which a step of a filter is too long for the friction of a wrist."""
LEAST_NOISE = (1e-6, 1e-3)
"""Of position, rad or m, and of torque, N·m: a filter that trusts its data blindly diverges."""
FRICTION_DEVIATION = 0.3
"""Of the friction coefficients before the first sample, N·m (s/rad)."""
LAM_FLOOR = np.array([0.3, *(0.02,) * 3, *(0.3,) * 3, *(0.02,) * 3])
"""|λ| is taken to be at least so large where its uncertainty is relative."""
TRUST = 0.05
"""Relative standard deviation of the first guess in λ."""
SPEED_VARIANCE = 1e-4
"""Of the first velocity, (rad/s)²."""
JITTER = 1e-10
"""Process noise of every velocity and step, (rad/s)², so that no covariance is singular."""


@dataclass(frozen=True, slots=True)
class Stream:
    """Samples for a filter.

    Attributes:
        dt: step, s.
        q, tau: (N, n).
        sigma_q, sigma_tau: standard deviations of their noise, (n,).
        names: friction columns.
        speed: ε of the Coulomb column.
    """

    dt: float
    q: Array
    tau: Array
    sigma_q: Array
    sigma_tau: Array
    names: tuple[str, ...]
    speed: float

    def friction(self, dq: Array) -> tuple[Array, Array]:
        """Friction columns (…, n, k) and their slopes in dq."""
        soft = np.tanh(dq / self.speed)
        one = np.ones_like(dq)
        table = {
            "viscous": (dq, one),
            "coulomb": (soft, (1 - soft**2) / self.speed),
            "offset": (one, 0 * one),
        }
        if not self.names:
            empty = np.zeros((*dq.shape, 0))
            return empty, empty
        columns, slopes = zip(*(table[name] for name in self.names), strict=True)
        return np.stack(columns, axis=-1), np.stack(slopes, axis=-1)

    @property
    def first_speed(self) -> Array:
        """dq at the beginning, from a line through the first 20 samples, (n,)."""
        count = min(20, len(self.q))
        return np.asarray(np.polyfit(np.arange(count) * self.dt, self.q[:count], 1)[0])


def stream_of(problem: Problem, method: str) -> Stream:
    """The training part of the recording at its full rate.

    Raises:
        IdentificationError: too slow, with holes, or friction that no filter knows.
        RecordingError: the clock is not uniform.
    """
    bench = problem.bench
    if bench is None or bench.recording.tau is None:
        raise IdentificationError(f"the method {method} needs the recording with its torque")
    log, columns = bench.recording, bench.friction
    foreign = set(columns.columns) - {"viscous", "coulomb", "offset"}
    if foreign:
        raise IdentificationError(
            f"the method {method} knows the friction columns viscous, coulomb and offset, not "
            f"{', '.join(sorted(foreign))}; leave them out"
        )
    whole = bench.span
    rows = (log.t >= whole[0]) & (log.t <= whole[1])
    part = log.take(rows, "Took the span of the training samples.")
    dt = uniform_step(part, f"run the {method}")
    if dt * SLOWEST > 1.0 + 1e-9 or len(segments(part.t)) > 1:
        raise IdentificationError(
            f"the method {method} follows the robot sample by sample and needs one stretch "
            f"without holes at {SLOWEST:g} Hz or more, got {len(segments(part.t))} at "
            f"{1 / dt:g} Hz; record at the controller's rate, or choose another method"
        )
    assert part.tau is not None  # noqa: S101  checked above
    sigma_q = np.maximum(noise_of(part.q), LEAST_NOISE[0])
    sigma_tau = np.maximum(noise_of(part.tau), LEAST_NOISE[1])
    names, speed = columns.columns, columns.coulomb_speed
    return Stream(dt, part.q, part.tau, sigma_q, sigma_tau, names, speed)


def noise_of(values: Array) -> Array:
    """Standard deviation of white noise on a smooth signal: third differences have 20 σ²."""
    return np.asarray(np.sqrt(np.mean(np.diff(values, 3, axis=0) ** 2, axis=0) / 20))


def prior_covariance(lib: Library, lam: Array) -> Array:
    """Of π, (10 n, 10 n), through ∂π/∂λ from relative deviations of λ."""
    jacobian = lib.pi_jacobian(lam)
    sigma = TRUST * np.maximum(np.abs(lam.reshape(lib.n_joints, -1)), LAM_FLOOR)
    blocks = jacobian * sigma[:, None, :]
    whole = np.zeros((lam.size, lam.size))
    size = blocks.shape[1]
    for k, block in enumerate(blocks):
        part = slice(k * size, (k + 1) * size)
        whole[part, part] = block @ block.T
    return whole
