"""Recordings of a robot whose parameters are known: along a trajectory, or in closed loop.

`closed_loop` lets the compiled simulator follow the trajectory: a computed-torque controller with a
given model, a plant with rotors and friction, sensors with noise; `follow` has no sensors.
"""

from collections.abc import Callable
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.files import write_text
from runtime.errors import IdentificationError, SimulationError
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import sample_times
from runtime.library import Array, Library
from runtime.library import compiled_programs as programs
from runtime.recording import Friction, Recording
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.friction.model import torque as friction_torque
from runtime.recording.settings import JointMotion, names_where
from runtime.simulation.plant import (
    Controller,
    Plant,
    SimulatedMotion,
    per_joint,
    require_no_springs,
)

LONGEST_SUBSTEP = 2e-4  # longest step of the plant, s; one step leaves an error of order h³

_CHUNK = 500  # periods between two reports of progress, at which Ctrl-C is handled too


def perturbed_lam(lib: Library, p: float, rng: np.random.Generator) -> Array:
    """Perturbed parameters λ_true + p λ_true ⊙ ε with ε ~ N(0, 1) per entry (Eq. 5.2, errata)."""
    return lib.lam0 * (1 + p * rng.normal(size=lib.lam0.size))


def ideal(
    lib: Library,
    trajectory: Trajectory,
    plant: Plant,
    rate_hz: float = 100.0,
    rng: np.random.Generator | None = None,
) -> Recording:
    """Exact motion along a trajectory, with the torque of the plant and its torque noise.

    Args:
        lib: the robot.
        trajectory: the motion.
        plant: true parameters, friction and noise.
        rate_hz: sampling rate, Hz.
        rng: source of the torque noise; None is without.

    Returns:
        The recording.
    """
    t = sample_times(trajectory.duration, rate_hz)
    q, dq, ddq, _ = trajectory.at(lib, t)
    tau = lib.inverse_dynamics(q, dq, ddq, plant.pi) + lib.known_torque(q) + _friction(plant, dq)
    if rng is not None:
        tau = tau + plant.torque_noise * rng.normal(size=tau.shape)
    sentence = f"Simulated {len(t)} samples at {rate_hz:g} Hz along the trajectory."
    states, names = (t, q, dq, ddq, tau), lib.joint_names
    return Recording(*states, name="ideal", joint_names=names, history=(sentence,))


_CONTROLLER = Controller()


def closed_loop(
    lib: Library,
    trajectory: Trajectory,
    plant: Plant,
    rng: np.random.Generator,
    rate_hz: float = 1000.0,
    progress: Callable[[float], None] | None = None,
    controller: Controller = _CONTROLLER,
) -> Recording:
    """Recording of the robot under its controller: q and dq with noise, τ behind the rotors.

    Args:
        lib: the robot.
        trajectory: the reference.
        plant: true parameters, friction, rotors and noise.
        rng: source of the noise.
        rate_hz: rate of controller and log, Hz.
        progress: called with the share that is done.
        controller: gains and model.

    Returns:
        The recording.

    Raises:
        SimulationError: the robot cannot follow, or the motion diverged.
    """
    t = sample_times(trajectory.duration, rate_hz)
    reference = np.stack(trajectory.at(lib, t)[:3], axis=1)
    noise = rng.normal(size=(3, *reference[:, 0].shape))
    noise[0] *= plant.position_noise
    noise[1] *= plant.velocity_noise
    felt = noise[:2].transpose(1, 0, 2) if controller.feels_noise else None
    motion = follow(lib, reference, plant, controller, rate_hz, felt, progress)
    q, dq = motion.q + noise[0], motion.dq + noise[1]
    tau, names = motion.link + plant.torque_noise * noise[2], lib.joint_names
    sentence = f"Simulated {len(t)} samples at {rate_hz:g} Hz in closed loop."
    states = t, q, dq, None, tau
    return Recording(*states, name="closed loop", joint_names=names, history=(sentence,))


def follow(
    lib: Library,
    reference: Array,  # (N, 3, n)
    plant: Plant,
    controller: Controller,
    rate_hz: float,
    noise: Array | None = None,  # (N, 2, n)
    progress: Callable[[float], None] | None = None,
) -> SimulatedMotion:
    """The plant under its controller: (M + J) ddq + h + f = τ, τ held for a period."""
    require_no_springs(lib)
    period = 1.0 / rate_hz
    steps = int(np.ceil(period / LONGEST_SUBSTEP * (1 - 1e-9)))
    parts = _body(lib, plant), _law(lib, plant, controller), reference, period
    loop = programs.CompiledClosedLoop(lib.binding, *parts, substeps=steps, noise=noise)
    for chunk in count(1):
        loop.run(_CHUNK)
        if loop.status or chunk * _CHUNK >= len(reference):
            break
        if progress is not None:
            progress(loop.done / len(reference))
    if loop.status:
        why = "the motion diverged"
        if loop.status == programs.NOT_POSITIVE:
            why = "its mass matrix is not positive definite, so no such robot exists"
        raise SimulationError(
            f"the simulated robot stopped after {loop.done * period:.3f} s: {why}; the plant is "
            "too far from the controller's model: lower the perturbation, or raise the rate"
        )
    return SimulatedMotion(*(np.ascontiguousarray(loop.log[:, k]) for k in range(5)))


def write_controller(
    path: Path,
    reference: str,
    controller: Controller,
    rotor: ArrayLike,
    rate_hz: float,
    start: float = 0.0,
) -> None:
    """Write the closed loop of a log as a controller file, atomically; the method iv reads it.

    reference: file of the trajectory beside it; rotor (n,) or one number [kg·m²]; start [s].
    """
    lines = ["[controller]"]
    values = {"stiffness": controller.stiffness, "damping": controller.damping}
    values |= {"rotor": rotor, "rate_hz": rate_hz}
    lines += [f"{key} = {np.asarray(value, dtype=float).tolist()}" for key, value in values.items()]
    lines += ["", "[reference]", f'trajectory = "{reference}"', f"start = {start}"]
    write_text(path, "\n".join(lines) + "\n")


def _friction(plant: Plant, dq: Array) -> Array:
    names = names_where(lambda column: column.in_closed_loop)
    phi = np.stack([per_joint(dq.shape[-1], getattr(plant, name), name) for name in names], axis=1)
    rows = friction_columns(JointMotion(dq), Friction(names, plant.coulomb_speed))
    return friction_torque(rows, phi)


def _body(lib: Library, plant: Plant) -> programs.ClosedLoopPlant:
    n = lib.n_joints
    if plant.pi.shape != lib.pi0.shape:
        raise IdentificationError(
            f"the simulated robot needs {lib.pi0.size} parameters, got {plant.pi.size}"
        )
    if not plant.coulomb_speed > 0:
        raise IdentificationError("the simulated robot's coulomb speed must be above 0 rad/s")
    parts = ("rotor", *names_where(lambda column: column.in_closed_loop))
    values = {name: per_joint(n, getattr(plant, name), name) for name in parts}
    return programs.ClosedLoopPlant(pi=plant.pi, coulomb_speed=plant.coulomb_speed, **values)


def _law(lib: Library, plant: Plant, controller: Controller) -> programs.ClosedLoopController:
    n = lib.n_joints
    rotor = plant.rotor if controller.rotor is None else controller.rotor
    return programs.ClosedLoopController(
        lib.pi0 if controller.pi is None else controller.pi,
        per_joint(n, rotor, "rotor of the controller"),
        per_joint(n, controller.stiffness, "stiffness"),
        per_joint(n, controller.damping, "damping"),
    )
