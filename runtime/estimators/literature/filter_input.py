"""Input of the filters: the recording at its full rate, its noise, friction in the state.

Measured torque is their input and measured position their output; the state is
[q, dq, parameters, δ], and one step of dt is

    (M + dt/2 S) a = τ + δ τ̇ − h − S dq − offset,   dq⁺ = dq + dt a,   q⁺ = q + dt (dq + dq⁺)/2

with M and h in the middle of the step. It is implicit in friction because smooth Coulomb friction
on a light wrist is far too fast for an explicit step; S = f(v̄)/v̄, its secant, keeps its sign and
cannot push a joint through rest. δ, one per joint, is the unknown time within a step at which the
torque acts (held or not, sampled before or after): an omitted δ of 0.2 ms biases the parameters by
many standard deviations.

v̄ and ā come from the smoothed positions, and the derivative of a step by the parameters is taken
there: the noise of τ over a small inertia is a large a that the robot never had, and a filter that
takes it for motion becomes overconfident about the inertia. Source: instruments against errors in
variables (Söderström 2018, Ch. 6); their use in a filter is ours.
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import NeedsError, RecordingError
from runtime.estimators.problem import Origin
from runtime.library import Array, Library
from runtime.library.parameters import lam_from_parts, link_columns, links
from runtime.recording import Friction, Recording
from runtime.recording.friction import COLUMNS, names_where
from runtime.recording.prepared import DifferentiatedRecording
from runtime.recording.preprocessing.filters import low_pass
from runtime.recording.preprocessing.segments import differentiate, segments, uniform_step

STATE_COLUMNS = names_where(lambda column: column.secant is not None)
"""Friction columns that the state of a filter can hold."""
SLOWEST = 200.0
"""Rate, Hz, below which a step of a filter is too long for the friction of a wrist."""
LEAST_NOISE = (1e-6, 1e-3)
"""Smallest standard deviation of position [rad, m] and torque [N·m]; without it filters diverge."""
FIRST_FRICTION = 0.3
"""Viscous and Coulomb friction before the first sample, and its standard deviation, N·m (s/rad)."""
LAM_FLOOR = lam_from_parts(log_mass=0.3, centre=0.02, rotation=0.3, axes=0.02)
"""Least |λ| for the relative standard deviation of the first guess."""
TRUST = 0.05
"""Relative standard deviation of the first guess in λ."""
SPEED_VARIANCE = 1e-4
"""Variance of the first velocity, (rad/s)²."""
SMOOTH_HZ = 20.0
"""Cut-off of ā and τ̇, Hz, at most a fifth of the rate: above motions of arms, below the noise."""
DELAY, WANDER = 0.5, 0.5
"""Standard deviation of δ, in steps, and of its change in a second: behind a rotor J it is
(M + J)⁻¹ M of half a step, and M depends on the posture."""
JITTER = 1e-10
"""Process noise of every velocity and step, (rad/s)², so that no covariance is singular."""


@dataclass(frozen=True, slots=True)
class FilterInput:
    """Samples for a filter."""

    dt: float  # step, s
    q: Array  # q, tau: (N, n)
    tau: Array
    # speed, acceleration, torque_rate: v̄, ā and τ̇ in the middle of every step, (N − 1, n)
    speed: Array
    acceleration: Array
    torque_rate: Array
    sigma_q: Array  # sigma_q, sigma_tau: standard deviations of their noise, (n,)
    sigma_tau: Array
    names: tuple[str, ...]  # friction columns
    width: float  # ε of the Coulomb column

    def friction(self, step: int) -> tuple[Array, Array]:
        """Secants column/dq at the smoothed speed of a step, and constant columns, each (n, k)."""
        speed = self.speed[step]
        secants_of = (COLUMNS[name].secant for name in self.names)
        parts = [secant(speed, self.width) for secant in secants_of if secant is not None]
        secants, constants = (
            np.array([part[i] for part in parts]).reshape(len(parts), speed.size).T for i in (0, 1)
        )
        return secants, constants

    @property
    def first_extra(self) -> Array:
        """φ joint by joint, and δ, before the first sample, (n k + n,)."""
        n = self.q.shape[1]
        start = [FIRST_FRICTION if COLUMNS[name].is_passive else 0.0 for name in self.names]
        return np.concatenate([np.tile(start, n), np.zeros(n)])

    @property
    def extra_variance(self) -> Array:
        """Variance of φ and δ before the first sample, (n k + n,)."""
        n = self.q.shape[1]
        friction = np.full(n * len(self.names), FIRST_FRICTION**2)
        return np.concatenate([friction, np.full(n, (DELAY * self.dt) ** 2)])

    def passive(self, phi: Array) -> Array:
        """φ (…, n, k) with negative dissipation set to 0, which would drive the joints."""
        least = [0.0 if COLUMNS[name].is_passive else -np.inf for name in self.names]
        return np.maximum(phi, least)

    @property
    def wander(self) -> float:
        """Process noise of δ per step, s²."""
        return (WANDER * self.dt) ** 2 * self.dt

    @property
    def first_speed(self) -> Array:
        """dq at the beginning, from a line through the first 20 samples, (n,)."""
        count = min(20, len(self.q))
        return np.asarray(np.polyfit(np.arange(count) * self.dt, self.q[:count], 1)[0])


def filter_input_of(log: Origin | None, method: str) -> FilterInput:
    """Return the training part of the recording at its full rate."""
    if log is None or log.recording.tau is None:
        raise NeedsError(
            f"the method {method} expects the recording with its torque, got neither; give the "
            "log itself"
        )
    first, last = log.span
    rows = (log.recording.t >= first) & (log.recording.t <= last)
    part = log.recording.take(rows, "Took the span of the training samples.")
    try:
        dt = uniform_step(part, f"run the {method}")
    except RecordingError:
        raise NeedsError(
            f"the method {method} works sample by sample and expects a uniform clock; "
            "resample the recording (max_gap_s in a recipe), or choose another method"
        ) from None
    if dt * SLOWEST > 1.0 + 1e-9 or len(segments(part.t)) > 1:
        raise NeedsError(
            f"the method {method} works sample by sample and expects a recording "
            f"without gaps at {SLOWEST:g} Hz or more, got {len(segments(part.t)) - 1} gaps at "
            f"{1 / dt:g} Hz; record at the controller's rate, or choose another method"
        )
    return filter_input_from(part, dt, log.friction)


def filter_input_from(part: Recording, dt: float, terms: Friction) -> FilterInput:
    """Return a recording with torque and a uniform clock as input of a filter."""
    tau = part.required("tau")
    bare = part.replace(dq=None, ddq=None, columns=None, column_names=())
    low_passed = low_pass(bare, min(SMOOTH_HZ, 0.2 / dt))
    smooth = DifferentiatedRecording.of(differentiate(low_passed))
    return FilterInput(
        dt=dt,
        q=part.q,
        tau=tau,
        speed=(smooth.dq[1:] + smooth.dq[:-1]) / 2,
        acceleration=(smooth.ddq[1:] + smooth.ddq[:-1]) / 2,
        torque_rate=np.diff(smooth.tau, axis=0) / dt,
        sigma_q=np.maximum(noise_of(part.q), LEAST_NOISE[0]),
        sigma_tau=np.maximum(noise_of(tau), LEAST_NOISE[1]),
        names=terms.columns,
        width=terms.coulomb_speed,
    )


def noise_of(values: Array) -> Array:
    """Standard deviation of white noise on a smooth signal, from third differences of 20 σ²."""
    return np.asarray(np.sqrt(np.mean(np.diff(values, 3, axis=0) ** 2, axis=0) / 20))


def prior_covariance(lib: Library, lam: Array) -> Array:
    """Covariance of π through ∂π/∂λ from relative standard deviations of λ.

    lam (10 n,) → (10 n, 10 n).
    """
    jacobian = lib.pi_jacobian(lam)
    sigma = TRUST * np.maximum(np.abs(links(lam)), LAM_FLOOR)
    blocks = jacobian * sigma[:, None, :]
    whole = np.zeros((lam.size, lam.size))
    for k, block in enumerate(blocks):
        whole[link_columns(k), link_columns(k)] = block @ block.T
    return whole


def process_noise(spread: Array, dt: float) -> Array:
    """Process noise of [q, dq] after a step.

    spread (n, n) → (2 n, 2 n).
    """
    both = np.concatenate([dt / 2 * spread, spread])
    noise = np.asarray(both @ both.T)
    n = len(spread)
    noise[range(n, 2 * n), range(n, 2 * n)] += JITTER
    return noise
