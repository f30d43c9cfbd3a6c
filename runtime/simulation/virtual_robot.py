"""The virtual robot: a log like a real one, of a robot whose every figure is known.

    record(lib, trajectory, settings=None, *, seed, truth_seed=0, payload=None, pi=None,
           progress=None) -> VirtualLog(recording, truth, motion)

`truth_seed` draws the robot, π of its links and the faults of its sensors; `seed` the noise of one
log. Logs of one `truth_seed` are of one robot. The model of its controller, about which
the truth is drawn, is `pi`, by default that of the URDF:

    P_true = P^½ exp(s S) P^½,   S symmetric, N(0, 1) on and N(0, ½) beside the diagonal

The controller ticks at its rate on measured q̂, dq̂; its torque arrives after the delay, within the
motor's limits, and is held. Between ticks MuJoCo integrates the plant, or `ReducedEngine` where
joints follow others, with friction against it. Same seeds, same bits.

Friction of a virtual joint is richer than the models that are fitted, and has a memory:

    f = c(dq) z + f_v dq + r f_c sin(w q + φ)
    c = f_c (1 ± a) + s f_c exp(−(dq/v_s)²) + k |τ|       + for dq > 0, − for dq < 0
    dz = (dq − |dq| z) dt / z_c                            Dahl's state, z ∈ [−1, 1]

f_c `coulomb`, a `asymmetry`, s `stribeck`, v_s `stribeck_speed`, f_v `viscous`, k `load` of the
torque τ behind the joint, r `ripple` with w `ripple_waves` per rad and φ `ripple_phase`, z_c
`dahl_stroke`. Source: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon et al. 2010 (load).

Sensors:

    q̂ = round((q + e) / Δ) Δ     dq̂: its differences over a period, through a low-pass of order one
    τ̂ = round((g τ + b + e) / Δ) Δ      τ behind the rotor: friction is in it, J ddq is not

A robot has a gain g = 1 + N(0, gain²) and a bias b = N(0, bias²) per joint for good; the noise e
is drawn for every log.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

from runtime.errors import SimulationError
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import sample_times
from runtime.library import Array, Integers, Library
from runtime.recording import Recording
from runtime.simulation.box_payload import Box, pi_from_pseudo
from runtime.simulation.plant import SimulatedMotion
from runtime.simulation.plant_engine import Engine, ReducedEngine, plant_engine
from runtime.simulation.settings import Sensors, VirtualFriction, VirtualRobotSettings, settings_of


@dataclass(frozen=True, slots=True)
class Calibration:
    """Gain and bias of the torque sensors of one robot, (n,) each."""

    gain: Array
    bias: Array


def calibration(sensors: Sensors, rng: np.random.Generator) -> Calibration:
    """Draw the calibration of one robot."""
    n = len(sensors.torque_gain)
    gain = 1 + sensors.torque_gain * rng.normal(size=n)
    return Calibration(gain, sensors.torque_bias * rng.normal(size=n))


def quantised(values: Array, quantum: Array) -> Array:
    """Values on the grid of a quantum."""
    step = np.where(quantum > 0, quantum, 1.0)
    return np.where(quantum > 0, np.round(values / step) * step, values)


def measured_torque(
    link: Array, sensors: Sensors, of: Calibration, rng: np.random.Generator
) -> Array:
    """Measured torque τ̂, (N, n), of that behind the rotors."""
    noise = sensors.torque_noise * rng.normal(size=link.shape)
    return quantised(of.gain * link + of.bias + noise, sensors.torque_quantum)


class Encoders:
    """Measured q̂ and dq̂ period by period, for the controller and the log."""

    def __init__(self, sensors: Sensors, noise: Array, period: float, places: Integers) -> None:
        """Encoders before the first period."""
        order = np.argsort(places)
        self._noise = noise
        quantum = sensors.position_quantum[order]
        self._inverse = 1 / np.where(quantum > 0, quantum, 1.0)
        self._quantum = np.where(quantum > 0, quantum, 0.0)
        self._exact = quantum <= 0
        self._any_exact = bool(self._exact.any())
        self._keep = np.exp(-2 * np.pi * sensors.velocity_cutoff_hz[order] * period)
        self._share = (1 - self._keep) / period
        self._before: Array | None = None
        self._speed = np.zeros(len(order))

    def read(self, k: int, q: Array, dq: Array) -> tuple[Array, Array]:
        """Measured state of a period from the true one; before the first one dq̂ is true."""
        raw = q + self._noise[k]
        measured = np.rint(raw * self._inverse) * self._quantum
        if self._any_exact:
            measured = np.where(self._exact, raw, measured)
        if self._before is None:
            self._speed = dq.copy()
        else:
            self._speed = self._keep * self._speed + self._share * (measured - self._before)
        self._before = measured
        return measured, self._speed


ASTRAY = 0.5  # distance from the reference at which the simulation is stopped, rad or m
_THINNEST = 1e-12  # least eigenvalue of a drawn pseudo-inertia over the largest
_CHUNK = 500  # ticks between two reports of progress, at which Ctrl-C is handled too


@dataclass(frozen=True, slots=True)
class Truth:
    """True values of a virtual robot and its log."""

    pi: Array  # of the links with the payload, (10 n,), from which its torques come
    pi_arm: Array  # without the payload
    settings: VirtualRobotSettings  # rotors, friction, sensors, drive, controller
    sensors: Calibration  # gain and bias of the torque sensors
    payload: Box | None  # or None
    seed: int  # seed, truth_seed: of this log, of the robot
    truth_seed: int
    saturated: Array  # share of the ticks at which a motor was at its limit, (n,)
    engine: str  # name and version; with another one the log differs in its last bits

    def facts(self, lib: Library) -> dict[str, Any]:
        """The truth as a JSON object."""
        return {
            "robot": lib.name,
            "engine": self.engine,
            "model_hash": lib.manifest.model_hash,
            "seed": self.seed,
            "truth_seed": self.truth_seed,
            "pi": self.pi.tolist(),
            "pi_arm": self.pi_arm.tolist(),
            "lam": lib.lam_from_pi(self.pi).tolist(),
            "beta": (lib.base_matrix @ self.pi).tolist(),
            "payload": self.payload.facts(lib) if self.payload else None,
            "torque_gain": self.sensors.gain.tolist(),
            "torque_bias": self.sensors.bias.tolist(),
            "saturated": self.saturated.tolist(),
            "rotor": self.settings.rotor.tolist(),
            "settings": self.settings.facts(),
            "settings_sha256": self.settings.sha256,
        }


@dataclass(frozen=True, slots=True)
class VirtualLog:
    """Recording, truth, and the true states of every tick."""

    recording: Recording
    truth: Truth
    motion: SimulatedMotion


def record(
    lib: Library,
    trajectory: Trajectory,
    settings: VirtualRobotSettings | None = None,
    *,
    seed: int,
    truth_seed: int = 0,
    payload: Box | None = None,
    pi: Array | None = None,
    progress: Callable[[float], None] | None = None,
) -> VirtualLog:
    """Let the virtual robot follow a trajectory.

    Args:
        lib: the robot.
        trajectory: reference of the controller.
        settings: of the robot, by default `settings_of(lib)`.
        seed: of the noise.
        truth_seed: of the robot.
        payload: in its hand; not part of the model of the controller.
        pi: model of the controller, (10 n,), by default `lib.pi0`.
        progress: called with the share that is done.

    Returns:
        Recording, truth and true states.

    Raises:
        SimulationError: MuJoCo is missing, or the robot cannot follow.
    """
    settings = settings or settings_of(lib)
    model = lib.pi0 if pi is None else np.asarray(pi, dtype=float)
    of_robot = np.random.SeedSequence(truth_seed).spawn(2)
    links = perturbed(lib, model, settings.spread, np.random.default_rng(of_robot[0]))
    sensors = calibration(settings.sensors, np.random.default_rng(of_robot[1]))
    # A log's noise must not repeat the draws of its robot where the seeds are equal.
    noise = [np.random.default_rng(s) for s in np.random.SeedSequence([seed, 1]).spawn(2)]
    held = links if payload is None else links + payload.pi(lib)

    t = sample_times(trajectory.duration, settings.rate_hz)
    reference = np.stack(trajectory.at(lib, t)[:3])
    jitter = settings.sensors.position_noise * noise[0].normal(size=reference[0].shape)
    simulator = _Simulator(lib, held, model, settings)
    measured, motion, saturated = simulator.run(reference, jitter, progress)
    tau = measured_torque(motion.link, settings.sensors, sensors, noise[1])
    recording = Recording(
        *(t, *measured, None, tau),
        name="virtual",
        joint_names=lib.joint_names,
        history=(f"Recorded {len(t)} samples at {settings.rate_hz:g} Hz of a virtual robot.",),
    )
    truth = Truth(
        *(held, links, settings, sensors, payload, seed, truth_seed, saturated, simulator.engine)
    )
    return VirtualLog(recording, truth, motion)


def perturbed(lib: Library, pi: Array, spread: float, rng: np.random.Generator) -> Array:
    """Parameters of another, physically consistent robot: P^½ exp(s S) P^½ for every P."""
    lib.lam_from_pi(pi)  # raises where a body is not physically consistent: it has no root
    draws = rng.normal(size=(lib.n_links, 4, 4))
    S = spread * (draws + np.swapaxes(draws, 1, 2)) / 2
    values, vectors = np.linalg.eigh(lib.pseudo_inertia(pi))
    # A plate without thickness has an eigenvalue 0, which rounding may make negative.
    values = np.maximum(values, _THINNEST * values.max(axis=1, keepdims=True))
    root = vectors * np.sqrt(values)[:, None] @ np.swapaxes(vectors, 1, 2)
    changed = root @ np.stack([expm(each) for each in S]) @ root
    return pi_from_pseudo(lib, (changed + np.swapaxes(changed, 1, 2)) / 2)


class SimulatedFriction:
    """The friction of all joints in time; z is its state."""

    def __init__(self, law: VirtualFriction, step: float, places: Integers) -> None:
        """Friction from z = 0, in the order of the engine."""
        order = np.argsort(places)
        self.z = np.zeros(len(order))
        f_c = law.coulomb[order]
        side = law.asymmetry[order]
        self._forward, self._backward = f_c * (1 + side), f_c * (1 - side)
        self._peak = law.stribeck[order] * f_c
        self._sharpness = -1 / law.stribeck_speed[order] ** 2
        self._viscous, self._load = law.viscous[order], law.load[order]
        self._ripple = law.ripple[order] * f_c
        self._waves, self._phase = law.ripple_waves[order], law.ripple_phase[order]
        self._bend = step / law.dahl_stroke[order]

    def advance(self, q: Array, dq: Array, tau: Array) -> tuple[Array, Array]:
        """Friction torque of a step and its slope in dq, (n,) each; moves the state z over it.

        z ← (z + h dq/z_c) / (1 + h |dq|/z_c) never leaves [−1, 1], however long the step.
        """
        travel = self._bend * dq
        way = 1 + np.abs(travel)
        z = (self.z + travel) / way
        level = np.where(dq > 0, self._forward, self._backward)
        level += self._peak * np.exp(self._sharpness * dq * dq)
        level += self._load * np.abs(tau)
        slope = self._viscous + level * self._bend * (1 - np.abs(z)) / way
        self.z = z
        f = level * z + self._viscous * dq + self._ripple * np.sin(self._waves * q + self._phase)
        return f, slope


class _Simulator:
    """Plant, friction, drive and controller; everything inside is in the order of MuJoCo."""

    def __init__(
        self, lib: Library, pi: Array, model: Array, settings: VirtualRobotSettings
    ) -> None:
        self._settings, step = settings, settings.step_s
        self._substeps = round(1 / (settings.rate_hz * step))
        self._plant = plant_engine(lib, pi, settings.rotor, step)
        self._belief = plant_engine(lib, model, settings.rotor, step, ranges=False)
        self._friction = SimulatedFriction(settings.friction, step, self._plant.places)
        self._delay = round(settings.delay_s / step)
        self._effort = self._plant.sorted(lib.limits()["effort"])
        self.engine = self._plant.name

    def run(
        self, reference: Array, jitter: Array, progress: Callable[[float], None] | None
    ) -> tuple[tuple[Array, Array], SimulatedMotion, Array]:
        """Measured q̂ and dq̂, true states, share of saturated ticks; in the order of the library."""
        plant, settings = self._plant, self._settings
        sort = plant.sorted
        encoders = Encoders(settings.sensors, sort(jitter), 1 / settings.rate_hz, plant.places)
        law = _law(self._belief, settings, sort(reference))
        wanted, rotor = sort(reference[0]), sort(settings.rotor)
        q, dq, applied, damping = plant.q, plant.dq, plant.applied, plant.damping
        q[:], dq[:] = wanted[0], sort(reference[1])[0]
        count, n = wanted.shape
        log, h = np.zeros((7, count, n)), plant.step_s
        commands, clipped, link = np.zeros((count, n)), np.zeros(n), np.zeros(n)
        advance, substeps, delay = self._friction.advance, self._substeps, self._delay
        for k in range(count):
            seen_q, seen_dq = encoders.read(k, q, dq)
            wished = law(k, seen_q, seen_dq)
            commands[k] = np.clip(wished, -self._effort, self._effort)
            clipped += commands[k] != wished
            log[:4, k] = seen_q, seen_dq, q, dq
            for j in range(substeps):
                # Until the first torque arrives the brakes hold what that torque will be.
                tau = commands[max(k * substeps + j - delay, 0) // substeps]
                f, slope = advance(q, dq, link)
                damping[:] = slope
                applied[:] = tau - f + slope * dq
                before = dq.copy() if j == 0 else None
                plant.advance()
                if before is not None:
                    ddq = (dq - before) / h
                    log[4:, k] = ddq, tau, tau - rotor * ddq
            link = log[6, k]
            if not np.abs(q - wanted[k]).max() < ASTRAY:
                raise SimulationError(
                    f"the virtual robot lost its trajectory after {k / settings.rate_hz:.3f} s "
                    f"(more than {ASTRAY:g} rad or m away): it hit the end of a joint, its motors "
                    "are too weak or the gains are wrong; slow the motion, lighten the payload, or "
                    "correct the settings"
                )
            if progress is not None and k % _CHUNK == 0:
                progress(k / count)
        seen_q, seen_dq, *true = (plant.restored(part) for part in log)
        return (seen_q, seen_dq), SimulatedMotion(*true), plant.restored(clipped / count)


def _law(
    belief: Engine | ReducedEngine, settings: VirtualRobotSettings, reference: Array
) -> Callable[[int, Array, Array], Array]:
    """The controller: its torque of tick k from q̂ and dq̂, with J in its model.

    computed torque: ID(q̂, dq̂, u),          u = ddq_d + K_d (dq_d − dq̂) + K_p (q_d − q̂)
    feedforward:     ID(q_d, dq_d, ddq_d) + D (K_d (dq_d − dq̂) + K_p (q_d − q̂)),  D = diag M(q_d(0))
    """
    q_d, dq_d, ddq_d = reference
    stiffness, damping = (belief.sorted(x) for x in (settings.stiffness, settings.damping))

    def correction(k: int, q: Array, dq: Array) -> Array:
        return np.asarray(damping * (dq_d[k] - dq) + stiffness * (q_d[k] - q))

    if settings.law == "computed_torque":
        return lambda k, q, dq: belief.inverse_dynamics(q, dq, ddq_d[k] + correction(k, q, dq))
    inertia = belief.mass_diagonal(q_d[0])

    def feedforward(k: int, q: Array, dq: Array) -> Array:
        return belief.inverse_dynamics(q_d[k], dq_d[k], ddq_d[k]) + inertia * correction(k, q, dq)

    return feedforward
