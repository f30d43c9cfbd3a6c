"""Recordings of a robot whose parameters are known: along a trajectory, or closed loop.

`ideal` evaluates τ = Y π along the trajectory (document Sec. 5.1). `closed_loop` integrates our
own forward dynamics under a computed-torque controller that knows only the URDF, with friction,
and measures with noise: a log as a bench would give it.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from runtime import friction
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.library import Array, Library
from runtime.recording import Friction, Recording


@dataclass(frozen=True, slots=True)
class Plant:
    """The robot that is simulated.

    Attributes:
        pi: true standard parameters, (10 n,).
        viscous, coulomb: friction per joint, N·m·s/rad and N·m.
        coulomb_speed: width of the smooth sign, rad/s.
        rotor: inertia J of every motor, reflected to its joint, kg·m²; the torque sensor does
            not see it, but without it no controller could hold a wrist.
        position_noise, velocity_noise, torque_noise: standard deviations, rad, rad/s, N·m.
    """

    pi: Array
    viscous: float = 0.0
    coulomb: float = 0.0
    coulomb_speed: float = 0.03
    rotor: float = 0.1
    position_noise: float = 0.0
    velocity_noise: float = 0.0
    torque_noise: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite(self.pi).all():
            raise IdentificationError(
                "the true parameters of the simulated robot are not finite; lower the perturbation"
            )
        for item in fields(self)[1:]:
            value = getattr(self, item.name)
            if not (np.isfinite(value) and value >= 0):
                raise IdentificationError(
                    f"the simulated robot's {item.name.replace('_', ' ')} cannot be {value:g}; "
                    "give a number from 0 up"
                )


STIFFNESS, DAMPING = 225.0, 30.0
"""Gains of the controller, 1/s² and 1/s: critically damped at 15 rad/s."""

MOST_SAMPLES = 10_000_000
"""More would not fit into the memory of an ordinary computer."""

RESOLVED = 2.0
"""Largest decay rate times step; the Runge–Kutta step of fourth order is stable up to 2.78."""


def perturbed_lam(lib: Library, p: float, rng: np.random.Generator) -> Array:
    """λ_true + p λ_true ⊙ ε with ε ~ N(0, 1) per entry (Eq. 5.2, errata)."""
    return lib.lam0 * (1 + p * rng.normal(size=lib.lam0.size))


def ideal(
    lib: Library,
    trajectory: Trajectory,
    plant: Plant,
    rate_hz: float = 100.0,
    rng: np.random.Generator | None = None,
) -> Recording:
    """Exact motion along the trajectory; torque of the plant with its torque noise."""
    t = sample_times(trajectory.duration, rate_hz)
    q, dq, ddq, _ = trajectory.at(lib, t)
    tau = lib.inverse_dynamics(q, dq, ddq, plant.pi) + _friction(plant, dq)
    if rng is not None:
        tau = tau + plant.torque_noise * rng.normal(size=tau.shape)
    sentence = f"Simulated {len(t)} samples at {rate_hz:g} Hz along the trajectory."
    return Recording(
        t, q, dq, ddq, tau, name="ideal", joint_names=lib.joint_names, history=(sentence,)
    )


def closed_loop(
    lib: Library,
    trajectory: Trajectory,
    plant: Plant,
    rng: np.random.Generator,
    rate_hz: float = 1000.0,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Forward dynamics under computed torque; logs q, dq and the link-side torque.

    The controller evaluates the URDF's model once per sample and knows rotors and friction; the
    plant, (M + J) ddq + h + f = τ_motor, moves on under the held torque. The sensor sits behind
    the rotor: τ = τ_motor − J ddq.

    Raises:
        IdentificationError: the motion diverged.
    """
    t = sample_times(trajectory.duration, rate_hz)
    wanted_q, wanted_dq, wanted_ddq, _ = trajectory.at(lib, t)
    n, step = lib.n_joints, 1.0 / rate_hz
    q, dq = wanted_q[0].copy(), wanted_dq[0].copy()
    log_q, log_dq, log_tau = (np.empty((len(t), n)) for _ in range(3))
    _require_resolved(lib, plant, step)
    for k in range(len(t)):
        command = wanted_ddq[k] + DAMPING * (wanted_dq[k] - dq) + STIFFNESS * (wanted_q[k] - q)
        motor = lib.inverse_dynamics(q, dq, command, lib.pi0) + plant.rotor * command
        motor = motor + _friction(plant, wanted_dq[k])
        log_q[k], log_dq[k] = q, dq
        log_tau[k] = motor - plant.rotor * _accelerate(lib, plant, q, dq, motor)
        q, dq = _advance(lib, plant, q, dq, motor, step)
        if not np.isfinite(q).all() or np.abs(dq).max() > 1e3:
            raise IdentificationError(
                f"the simulated motion diverged after {t[k]:.3f} s; the true robot is too far "
                "from the controller's model: lower the perturbation, or raise the rate"
            )
        if progress is not None and k % 100 == 0:
            progress(k / len(t))
    return Recording(
        t,
        log_q + plant.position_noise * rng.normal(size=log_q.shape),
        log_dq + plant.velocity_noise * rng.normal(size=log_dq.shape),
        None,
        log_tau + plant.torque_noise * rng.normal(size=log_tau.shape),
        name="closed loop",
        joint_names=lib.joint_names,
        history=(f"Simulated {len(t)} samples at {rate_hz:g} Hz in closed loop.",),
    )


def sample_times(duration: float, rate_hz: float) -> Array:
    """0, 1/rate, … up to the duration, s.

    Raises:
        IdentificationError: they make no clock, or one of more than `MOST_SAMPLES`.
    """
    samples = duration * rate_hz
    if not (duration > 0 and rate_hz > 0 and samples < MOST_SAMPLES):
        raise IdentificationError(
            "a motion needs a positive duration and sampling rate that make fewer than "
            f"{MOST_SAMPLES:,} samples, got {duration:g} s and {rate_hz:g} Hz"
        )
    return np.arange(round(samples) + 1) / rate_hz


def _friction(plant: Plant, dq: Array) -> Array:
    terms = Friction(("viscous", "coulomb"), plant.coulomb_speed)
    rows = friction.columns(friction.Motion(np.atleast_2d(dq)), terms)
    phi = np.tile([plant.viscous, plant.coulomb], (rows.shape[1], 1))
    return friction.torque(rows, phi).reshape(np.shape(dq))


def _accelerate(lib: Library, plant: Plant, q: Array, dq: Array, motor: Array) -> Array:
    return lib.forward_dynamics(q, dq, motor - _friction(plant, dq), plant.pi, plant.rotor)


def _advance(
    lib: Library, plant: Plant, q: Array, dq: Array, motor: Array, h: float
) -> tuple[Array, Array]:
    """One Runge–Kutta step of fourth order under the held motor torque."""
    v1, a1 = dq, _accelerate(lib, plant, q, dq, motor)
    v2 = dq + h / 2 * a1
    a2 = _accelerate(lib, plant, q + h / 2 * v1, v2, motor)
    v3 = dq + h / 2 * a2
    a3 = _accelerate(lib, plant, q + h / 2 * v2, v3, motor)
    v4 = dq + h * a3
    a4 = _accelerate(lib, plant, q + h * v3, v4, motor)
    return q + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), dq + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def _require_resolved(lib: Library, plant: Plant, h: float) -> None:
    """The stiffest part, smooth Coulomb friction on the lightest joint, must be resolved by h."""
    inertia = plant.rotor + np.linalg.eigvalsh(lib.mass_matrix(lib.home, plant.pi))[0]
    rate = (plant.viscous + plant.coulomb / plant.coulomb_speed) / inertia
    if rate * h > RESOLVED:
        raise IdentificationError(
            f"friction changes the speed of the lightest joint at {rate:.0f} /s, too fast for "
            f"steps of {h:g} s; raise the rate or the rotor inertia, or lower the friction"
        )
