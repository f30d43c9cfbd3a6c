"""The simulated robot and its controller: parameters, friction, rotors, noise and gains."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import IdentificationError, SimulationError
from runtime.library import Array, Library


@dataclass(frozen=True, slots=True)
class Plant:
    """The robot that is simulated; values of joints are one number for all of them or (n,)."""

    pi: Array  # true standard parameters, (10 n,)
    viscous: ArrayLike = 0.0  # viscous, coulomb: friction, N·m·s/rad and N·m
    coulomb: ArrayLike = 0.0
    offset: ArrayLike = 0.0  # constant torque, N·m
    coulomb_speed: float = 0.03  # width of the smooth sign, rad/s
    # inertia J of every motor, reflected to its joint, kg·m². The torque sensor does not measure
    # it, but without it no controller could hold a wrist
    rotor: ArrayLike = 0.1
    position_noise: float = 0.0  # position_noise, velocity_noise, torque_noise: σ, rad, rad/s, N·m
    velocity_noise: float = 0.0
    torque_noise: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite(self.pi).all():
            raise IdentificationError(
                "the true parameters of the simulated robot are not finite; lower the perturbation"
            )
        for item in fields(self)[1:]:
            value = np.asarray(getattr(self, item.name), dtype=float)
            least = -np.inf if item.name == "offset" else 0.0
            if not (np.isfinite(value) & (value >= least)).all():
                raise IdentificationError(
                    f"the simulated robot's {item.name.replace('_', ' ')} cannot be {value}; "
                    "give a finite number, from 0 up"
                )


@dataclass(frozen=True, slots=True)
class Controller:
    """Controller τ = ID(q, dq, u; π_c) + J_c u, u = ddq_d + K_d (dq_d − dq) + K_p (q_d − q)."""

    pi: Array | None = None  # model of the controller, (10 n,); None is that of the URDF
    rotor: ArrayLike | None = None  # J_c; None is that of the plant
    stiffness: ArrayLike = 225.0  # stiffness, damping: K_p, 1/s², and K_d, 1/s; one number or (n,)
    damping: ArrayLike = 30.0
    feels_noise: bool = False  # the controller uses the measured q and dq instead of the true ones


@dataclass(frozen=True, slots=True)
class SimulatedMotion:
    """States and torques at the beginning of every period, (N, n) each."""

    q: Array  # q, dq, ddq: states
    dq: Array
    ddq: Array
    motor: Array  # torque that the controller commands
    link: Array  # torque behind the rotors, τ − J ddq


def per_joint(n: int, value: ArrayLike, name: str) -> Array:
    """One number for all joints, or one for each, as (n,)."""
    array = np.asarray(value, dtype=float)
    if array.shape not in {(), (n,)}:
        raise IdentificationError(
            f"{name} needs one number, or one for each of the {n} joints, got {array.size}; "
            "give that many"
        )
    return np.array(np.broadcast_to(array, (n,)))


def has_mechanism(lib: Library) -> bool:
    """Whether joints follow others, or springs and curves of known stiffness act on them."""
    manifest = lib.manifest
    has_followers = manifest.coupling is not None or bool(manifest.loops)
    return has_followers or "known_torque" in manifest.kernels


def require_no_springs(lib: Library) -> None:
    """Raise SimulationError where springs or torque curves act, which compiled simulations lack."""
    if "known_torque" in lib.manifest.kernels:
        raise SimulationError(
            f"springs or torque curves act on '{lib.name}', which the compiled simulation "
            "does not contain; use --engine mujoco (record), or --ideal (ideal)"
        )
