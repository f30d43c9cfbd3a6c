"""What the filters work on: the recording at its full rate, its noise, the friction in their state.

Measured torque is their input and measured position their output; the state is
[q, dq, parameters], and one step of dt is

    (M + dt S) dq⁺ = M dq + dt (τ − h − offset),   q⁺ = q + dt (dq + dq⁺)/2,   S = f(dq)/dq,

because smooth Coulomb friction on a light wrist is far too fast for an explicit step. S, the secant
of friction, keeps its sign: unlike the tangent it cannot push a joint through rest.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import NeedsError, RecordingError
from runtime.library import Array, Library
from runtime.preprocessing.segments import segments, uniform_step
from runtime.problem import Problem

SLOWEST = 200.0
"""Hz below which a step of a filter is too long for the friction of a wrist."""
LEAST_NOISE = (1e-6, 1e-3)
"""Of position, rad or m, and of torque, N·m: a filter that trusts its data blindly diverges."""
FIRST_FRICTION = 0.3
"""Viscous and Coulomb friction before the first sample, and its deviation, N·m (s/rad)."""
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

    def friction(self, dq: Array) -> tuple[Array, Array, Array]:
        """Secants s = column/dq, ds/d(dq), and constant columns; each (…, n, k)."""
        inside = np.abs(dq) < 1e-3 * self.speed
        safe = np.where(inside, self.speed, dq)
        soft = np.tanh(safe / self.speed)
        secant = np.where(inside, 1 / self.speed, soft / safe)
        bend = ((1 - soft**2) / self.speed - soft / safe) / safe
        bend = np.where(inside, -2 / 3 * dq / self.speed**3, bend)
        one, zero = np.ones_like(dq), np.zeros_like(dq)
        table = {
            "viscous": (one, zero, zero),
            "coulomb": (secant, bend, zero),
            "offset": (zero, zero, one),
        }
        if not self.names:
            empty = np.zeros((*dq.shape, 0))
            return empty, empty, empty
        parts = zip(*(table[name] for name in self.names), strict=True)
        secants, bends, constants = (np.stack(part, axis=-1) for part in parts)
        return secants, bends, constants

    @property
    def first_friction(self) -> Array:
        """φ before the first sample, joint by joint, (n k,)."""
        start = [0.0 if name == "offset" else FIRST_FRICTION for name in self.names]
        return np.tile(start, self.q.shape[1])

    def passive(self, phi: Array) -> Array:
        """φ (…, n, k) without what drives the joints: negative friction would run away."""
        least = [-np.inf if name == "offset" else 0.0 for name in self.names]
        return np.maximum(phi, least)

    @property
    def first_speed(self) -> Array:
        """dq at the beginning, from a line through the first 20 samples, (n,)."""
        count = min(20, len(self.q))
        return np.asarray(np.polyfit(np.arange(count) * self.dt, self.q[:count], 1)[0])


def stream_of(problem: Problem, method: str) -> Stream:
    """The training part of the recording at its full rate.

    Raises:
        NeedsError: too slow, not uniform, with holes, or friction that no filter knows.
    """
    bench = problem.bench
    if bench is None or bench.recording.tau is None:
        raise NeedsError(f"the method {method} needs the recording with its torque")
    log, columns = bench.recording, bench.friction
    foreign = set(columns.columns) - {"viscous", "coulomb", "offset"}
    if foreign:
        raise NeedsError(
            f"the method {method} knows the friction columns viscous, coulomb and offset, not "
            f"{', '.join(sorted(foreign))}; leave them out"
        )
    whole = bench.span
    rows = (log.t >= whole[0]) & (log.t <= whole[1])
    part = log.take(rows, "Took the span of the training samples.")
    try:
        dt = uniform_step(part, f"run the {method}")
    except RecordingError:
        raise NeedsError(
            f"the method {method} follows the robot sample by sample and needs a uniform clock; "
            "resample the recording (max_gap_s in a recipe), or choose another method"
        ) from None
    if dt * SLOWEST > 1.0 + 1e-9 or len(segments(part.t)) > 1:
        raise NeedsError(
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


def process_noise(spread: Array, dt: float) -> Array:
    """Of [q, dq] after a step, (2 n, 2 n), from the effect of the torque's noise on dq, (n, n)."""
    both = np.concatenate([dt / 2 * spread, spread])
    noise = np.asarray(both @ both.T)
    n = len(spread)
    noise[range(n, 2 * n), range(n, 2 * n)] += JITTER
    return noise
